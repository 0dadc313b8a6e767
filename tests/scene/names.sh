#!/bin/sh
# Names of files are those of whoever made the folder: no command shows what a terminal would obey, whether the file is
# right, wrong or not there, and a table of files keeps its columns. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/names.sh PROGRAM ROBOT PROBLEM
set -u

program=$(realpath "$1") robot=$(realpath "$2") problem=$(realpath "$3")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
wrong=0
# ESC ] 0 ; BEL sets a title; U+009B begins commands of eight bits; U+202E turns the direction.
evil=$(printf 'e\033]0;x\007\302\233\342\200\256\\,"\nq')
"$program" new pendulum plain.toml >/dev/null
sed '/^name/d' plain.toml >"$evil.toml"
echo 'a = ' >"$evil.wrong.toml"
cp "$robot" "$evil.urdf"
cp "$problem" "$evil.dat"
mkdir "$evil"

# obeys WHAT: whether something in `said` would be.
quiet() {
  if LC_ALL=C grep -q "$(printf '[\001-\010\013-\037\177]\\|\302\233\\|\342\200\256')" said; then
    echo "$*: a terminal would obey:"
    cat -v said
    wrong=1
  fi
}
try() { "$program" "$@" >said 2>&1; quiet "$1"; }

for end in .toml .wrong.toml .none.toml .dat ''; do
  try check "$evil$end"
  try plan "$evil$end"
  try run "$evil$end" --quiet --end 0.01
  try cost "$evil$end" --tolerances 1e-3 --reference 1e-4
  try sweep "$evil$end" --quiet --vary smooth.tolerance=1e-3
  try import "$evil$end"
  try contact "$evil$end"
  try "$evil$end"
  try run plain.toml "$evil$end"
  try run plain.toml --quiet --restart "$evil$end"
done
for option in csv svg html state vtk; do
  try run plain.toml --quiet --end 0.01 --$option "$evil.$option"
  try run plain.toml --quiet --end 0.01 --$option "$evil.toml/$option"
  try run "$evil.toml" --quiet --end 0.01 --$option "$evil.toml"
done
try import "$evil.urdf" --out "$evil.new.toml"
try import "$evil.urdf" --out "$evil.new.toml"
try new pendulum "$evil.new.toml"
try new pendulum "$evil.other.toml"
try sweep plain.toml --quiet --vary smooth.tolerance=1e-3 --out "$evil.csv"

"$program" contact --csv "$evil.dat" "$problem" | sed 's/"[^"]*\(""[^"]*\)*"/name/' >table
[ "$(wc -l <table)" -eq 3 ] && awk -F, 'NR == 1 { n = NF } NF != n { exit 1 }' table ||
  { echo "columns of a table:"; cat table; wrong=1; }
[ $wrong -eq 0 ] && echo "no name reaches the terminal as a command"
exit $wrong
