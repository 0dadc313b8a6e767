#!/bin/sh
# Does a tutorial do what it says? Its programs and commands are run in a new folder, and each line of a
# text block must be a part of what they print, in that order. SPDX-License-Identifier: BSD-3-Clause
#
#   sh docs/check.sh PAGE TETHER [PROGRAM...]
set -eu

page=$1 tether=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if grep -q '^```sh' "$page"; then
  [ -x "$tether" ] || { echo "the program tether is not built: the commands of $page are not run"; exit 77; }
  mkdir "$work/bin"
  ln -s "$tether" "$work/bin/tether"
  PATH=$work/bin:$PATH
fi
mkdir "$work/run"
cd "$work/run"
awk '/^```/ { name = inside ? "" : $2; kind = inside ? "" : substr($1, 4); inside = !inside; next }
     kind == "toml" && name != "" { print >name }
     kind == "sh" { print >"../commands" }
     kind == "text" { print >"../wanted" }' "$page"
{
  for program in "$@"; do "$program"; done
  if [ -f ../commands ]; then sh -eu ../commands; fi
} >../said 2>../problems || { cat ../said ../problems; echo "$page: a command failed"; exit 1; }
awk 'NR == FNR { wanted[++n] = $0; next }
     next_line <= n && index($0, wanted[next_line]) { ++next_line }
     BEGIN { next_line = 1 }
     END { if (next_line <= n) { print "not printed: " wanted[next_line]; exit 1 } }' ../wanted ../said ||
  { cat ../said; exit 1; }
echo "$(basename "$page"): as it says"
