#!/bin/sh
# A program that knows nothing of Tether does what the one does that was changed for it.
# check.sh <libtether_preload.so> <pendulum_rows.so> <drop_in_before> <drop_in_after>
# SPDX-License-Identifier: BSD-3-Clause
set -u
preload=$1 rows=$2 before=$3 after=$4
fail() { echo "$*" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$after" >"$work/wanted" || fail "$after fails"
"$before" >"$work/plain" || fail "$before fails"
LD_PRELOAD=$preload TETHER_CONSTRAINTS=$rows TETHER_STATISTICS=1 "$before" >"$work/projected" \
  2>"$work/statistics" || fail "fails with constraints: $(cat "$work/statistics")"
diff "$work/wanted" "$work/projected" || fail "not the results of the recompiled program"
grep -q projections "$work/statistics" || fail "no statistics: $(cat "$work/statistics")"

# Without constraints the program is as it was, and told so once.
LD_PRELOAD=$preload TETHER_CONSTRAINTS='' "$before" >"$work/unset" 2>"$work/said" || fail "fails when unset"
diff "$work/plain" "$work/unset" || fail "changed without constraints"
[ "$(grep -c 'not set' "$work/said")" = 1 ] || fail "said: $(cat "$work/said")"

# Constraints that cannot be had stop the program; they are not left out in silence.
for wrong in "$work/absent.so" "$preload" "$work/said"; do
  LD_PRELOAD=$preload TETHER_CONSTRAINTS=$wrong "$before" >/dev/null 2>"$work/said" && fail "$wrong is accepted"
  grep -q 'IDASolve returned -22' "$work/said" || fail "$wrong: $(cat "$work/said")"
  grep -q libtether_preload "$work/said" || fail "$wrong is not named: $(cat "$work/said")"
done

# Programs without SUNDIALS inherit LD_PRELOAD and run.
[ "$(LD_PRELOAD=$preload TETHER_CONSTRAINTS=$rows sh -c 'echo yes')" = yes ] || fail "a shell does not start"
