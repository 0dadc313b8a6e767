#!/bin/sh
# Builds the package for Octave and runs its tests and Octave's own of ode15i and ode15s under it.
# check.sh <libtether_preload.so> <include flags> <work folder>; exit 77: no Octave with SUNDIALS here
# SPDX-License-Identifier: BSD-3-Clause
set -eu
preload=$1 flags=$2 work=$3
package=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)

command -v mkoctfile >/dev/null && command -v octave-cli >/dev/null ||
  { echo "skipped: no octave-cli and mkoctfile (Debian: octave, octave-dev)"; exit 77; }
octave-cli --no-history --norc -q --eval 'exit (! (exist ("__ode15__") == 3))' ||
  { echo "skipped: this Octave has no ode15s in a module of its own"; exit 77; }

rm -rf "$work"
mkdir -p "$work"
cp -r "$package/inst/." "$package/PKG_ADD" "$package/PKG_DEL" "$work"
cp -r "$package/src" "$work/src"
make -s -C "$work/src" TETHER_FLAGS="$flags" TETHER_PRELOAD="$preload"
mv "$work/src/__tether__.oct" "$work"

# A name can be tested where it is found: Octave's own solvers by their files.
cat >"$work/all_tests.m" <<'END'
own = {which("ode15i"), which("ode15s")};
[t, y] = ode15s (@(t, y) -y, [0, 1], 1);  # a session that has used the solver before
addpath (fileparts (mfilename ("fullpath")));
failed = 0;
for name = [{"tether_constraints", "ode15i", "ode15s"}, own]
  [passed, all] = test (name{1}, "quiet", stdout);
  printf ("%s: %d of %d tests\n", name{1}, passed, all);
  failed += all == 0 || passed < all;
endfor
exit (failed);
END
octave-cli --no-history --norc -q "$work/all_tests.m"

# Who asks for no constraints hears nothing.
said=$(octave-cli --no-history --norc -q --eval \
  "addpath ('$work'); [t, y] = ode15s (@(t, y) -y, [0, 1], 1); [t, y] = ode15i (@(t, y, v) v + y, [0, 1], 1, -1);" 2>&1)
[ -z "$said" ] || { echo "without constraints: $said"; exit 1; }
