#!/bin/sh
# Every test that SECURITY.md names is there. SPDX-License-Identifier: BSD-3-Clause
set -eu
cd "$(dirname -- "$0")/.."

# The last column of the table, and what stands in brackets below it: names between backticks.
missing=0
claims=$(mktemp) tests=$(mktemp)
trap 'rm -f "$claims" "$tests"' EXIT
# Names of tests may be broken into two lines by the formatter: spaces count for nothing.
find tests python/tests \( -name '*.cpp' -o -name '*.py' -o -name CMakeLists.txt \) -exec cat {} + |
  tr -d ' "\n' >"$tests"
{ grep '^|' SECURITY.md | sed 's/|[^|]*$//; s/.*|//'; sed -n 's/.*(`\(.*\)`).*/`\1`/p' SECURITY.md; } |
  grep -o '`[^`]*`' | tr -d '`' | sort -u >"$claims"
count=0
while read -r name; do
  case $name in
    *...) pattern=${name%...} ;;
    fuzz:*) pattern="tether_fuzz_target(${name#fuzz:} " ;;
    *) pattern=$name ;;
  esac
  count=$((count + 1))
  if ! grep -qF -- "$(printf %s "$pattern" | tr -d ' ')" "$tests"; then
    echo "SECURITY.md names a test that is not there: $name" >&2
    missing=1
  fi
done <"$claims"
# A row without a test is a claim that nothing holds.
if grep '^|' SECURITY.md | tail -n +3 | sed 's/|[^|]*$//; s/.*|//' | grep -nv '`'; then
  echo "SECURITY.md has a row that names no test" >&2
  missing=1
fi
[ "$count" -ge 15 ] || { echo "only $count names found in SECURITY.md: has its table changed?" >&2; exit 1; }
[ $missing -eq 0 ] && echo "$count tests that SECURITY.md names are there"
exit $missing
