#!/bin/sh
# Do the documents show these programs? The diff block of the one beside them is `diff -U 1 before.cpp after.cpp`, and
# each line of the first cpp block of the project's README stands in after.cpp.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh check_readme.sh README_OF_THE_PROJECT
set -eu

readme=$(CDPATH='' cd -- "$(dirname -- "$1")" && pwd)/$(basename -- "$1")
cd "$(dirname -- "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Without the two header lines, which hold times of day.
diff -U 1 before.cpp after.cpp | sed 1,2d >"$work/real" || true
sed -n '/^```diff$/,/^```$/p' README.md | sed '1d;/^```$/,$d' >"$work/shown"
diff "$work/shown" "$work/real" || {
  echo "examples/drop_in/README.md does not show 'diff -U 1 examples/drop_in/before.cpp examples/drop_in/after.cpp'" >&2
  exit 1
}

# A line may explain itself by a comment at its end.
sed -n '/^```cpp$/,/^```$/p' "$readme" | sed '1d;/^```$/,$d;s| *//.*||' >"$work/lines"
[ -s "$work/lines" ] || { echo "$readme has no cpp block" >&2; exit 1; }
while IFS= read -r line; do
  grep -qxF -- "$line" after.cpp || { echo "README.md shows a line that is not in after.cpp: $line" >&2; exit 1; }
done <"$work/lines"
