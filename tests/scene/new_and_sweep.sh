#!/bin/sh
# `tether new`: every kind is right, runs and meets its expectations. `tether sweep`: rows in order,
# right, the same with any number of processes; wrong values and failures are rows. `-`: standard
# input and output. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/new_and_sweep.sh PROGRAM
set -u

program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
wrong=0
complain() { echo "$*"; wrong=1; }
# wanted <code> <what> <command...>
wanted() {
  code=$1 what=$2
  shift 2
  "$@" >said 2>&1
  got=$?
  [ $got -eq "$code" ] || { complain "$what: exit code $got, expected $code"; cat said; }
}

for kind in $("$program" new --list | cut -d' ' -f1); do
  wanted 0 "new $kind" "$program" new "$kind"
  wanted 0 "check $kind" "$program" check "$kind.toml"
  wanted 0 "run $kind" "$program" run "$kind.toml" --quiet
  grep -q '^# ' "$kind.toml" || complain "$kind has no comments"
  grep -q '^\[\[expect\]\]' "$kind.toml" || complain "$kind expects nothing"
  "$program" new "$kind" - | cmp - "$kind.toml" || complain "$kind differs on the standard output"
done
[ -f mechanism_with_contact.toml ] || complain "kinds are missing"
echo mine >contact.toml
wanted 2 "a file that is there" "$program" new contact
grep -q mine contact.toml || complain "new replaced a file"
wanted 0 "a file that is there, by force" "$program" new contact --force
wanted 2 "no kind" "$program" new
wanted 2 "an unknown kind" "$program" new nothing
wanted 2 "a folder that cannot be" "$program" new contact /proc/none/a.toml

# 2 ways of friction: the slide of a block is v^2 / (2 mu g).
cat >block.toml <<'END'
[scene]
name = "block"
end = 1
gravity = [0, 0, -10]
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "a"
[[body]]
name = "block"
shape = "points"
points = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
mass = 1
inertia = [1, 1, 1]
velocity = [1, 0, 0]
material = "a"
[[pair]]
between = ["a", "a"]
friction = 0.2
[[expect]]
quantity = "distance_moved"
body = "block"
at_least = 0.21
END
sweep="$program sweep block.toml --quiet"
wanted 1 "a sweep" $sweep --vary pair.friction=0.1:0.5:9 --out a.csv --jobs 3
wanted 1 "a sweep in one process" $sweep --vary pair.friction=0.1:0.5:9 --out b.csv --jobs 1
# All but the processor time, which is the field before the expectation's.
body() { awk -F, -v OFS=, '{ $17 = ""; print }' "$1"; }
[ "$(body a.csv)" = "$(body b.csv)" ] || complain "processes change rows"
[ "$(cut -d, -f1 a.csv | tr '\n' ' ')" = "pair.friction 0.1 0.15 0.2 0.25 0.3 0.35 0.4 0.45 0.5 " ] ||
  complain "values: $(cut -d, -f1 a.csv)"
awk -F, 'NR > 1 { d = 1 / (20 * $1); if ($18 < d - 2e-3 || $18 > d + 2e-3) bad = 1;
                  if (($2 == "ok") != (d >= 0.21)) bad = 1 } END { exit bad }' a.csv ||
  complain "slides are not v^2 / (2 mu g): $(cat a.csv)"
wanted 3 "a value that is wrong" $sweep --vary pair.friction=0.1,-1,0.2 --out c.csv
[ "$(cut -d, -f2 c.csv | tr '\n' ' ')" = "status ok wrong ok " ] || complain "statuses: $(cat c.csv)"
grep -q '^-1,wrong,.*"*.*friction = -1' c.csv || complain "not said: $(cat c.csv)"
awk -F, 'NR == 1 { n = NF } NR > 1 && $2 == "ok" && NF != n { exit 1 }' c.csv || complain "fields: $(cat c.csv)"
wanted 2 "all values wrong" $sweep --vary pair.friction=-1,-2 --out d.csv
for bad in friction=1 pair.friktion=1 pair.3.friction=1 none.x=1 body.mass=1 body.block.name=1 pair.friction= \
  pair.friction=1:2 pair.friction=1:2:1 pair.friction=1:2:1e9 pair.friction=0:1:3:log pair.friction=nan \
  body.block.velocity.w=1 body.block.velocity=1; do
  wanted 2 "--vary $bad" $sweep --vary "$bad" --out e.csv
done
wanted 2 "too many combinations" $sweep --vary pair.friction=0:1:1000 --vary body.block.mass=1:2:1000 --out e.csv
[ ! -f e.csv ] || complain "a table of nothing"
$sweep --vary body.block.velocity.x=1,2 --vary 'stepping.step=1e-3:1e-2:2:log' >f.csv 2>said
[ "$(cut -d, -f1-2 f.csv | tr '\n' ' ')" = "body.block.velocity.x,stepping.step 1,0.001 1,0.01 2,0.001 2,0.01 " ] ||
  complain "combinations: $(cat f.csv)"
$program sweep - --quiet --vary body.2.mass=1 <block.toml >g.csv 2>said || complain "a sweep of the standard input"
wanted 2 "a full disk" sh -c "$sweep --vary pair.friction=0.2 >/dev/full"

# The standard output has the file and nothing else.
"$program" run block.toml --quiet --csv h.csv >/dev/null
"$program" run - --quiet --csv - <block.toml 2>said | cmp - h.csv || complain "--csv - differs"
grep -q 'energy' said || complain "no summary on the standard error"
wanted 2 "two on the standard output" "$program" run block.toml --csv - --html -
wanted 2 "a film on the standard output" "$program" run block.toml --vtk -
{ "$program" run block.toml --quiet --csv - 2>/dev/null; echo $? >code; } | head -c 10 >/dev/null
[ "$(cat code)" -eq 141 ] || complain "a reader that leaves: $(cat code)"
"$program" check - <block.toml >/dev/null || complain "check of the standard input"
"$program" plan - <block.toml >/dev/null || complain "plan of the standard input"
echo 'a = ' | "$program" check - 2>&1 | grep -q '^standard input:1' || complain "place in the standard input"
# Completion offers each command, and each option that its help names.
completion=${0%/tests/scene/*}/packaging/tether.bash-completion
if command -v bash >/dev/null && [ -f "$completion" ]; then
  offered() {
    bash -c '. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _tether; printf "%s\n" "${COMPREPLY[@]}"' \
      bash "$completion" "$@"
  }
  "$program" --help | sed -n '/^Subcommands/,$ s/^  \([a-z]*\) .*/\1/p' | sort >commands
  offered "$program" '' | grep -v '^--' | sort | cmp - commands || complain "commands of the completion"
  while read -r command; do
    "$program" "$command" --help | grep -o '^  [-a-z,]*--[a-z-]*' | sed 's/.*--/--/' | grep -v -e --version | sort -u >options
    offered "$program" "$command" -- | sort >given
    cmp given options || complain "options of $command: $(diff given options)"
  done <commands
  offered "$program" new mech | grep -qx mechanism || complain "kinds of the completion"
fi
[ $wrong -eq 0 ] && echo "new, sweep and - do what they say"
exit $wrong
