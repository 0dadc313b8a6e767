#!/bin/sh
# Does the first diff block of the given README equal `diff -u before.cpp after.cpp`?
# SPDX-License-Identifier: BSD-3-Clause
set -eu

readme=$(CDPATH='' cd -- "$(dirname -- "$1")" && pwd)/$(basename -- "$1")
cd "$(dirname -- "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Without the two header lines, which hold times of day.
diff -U 1 before.cpp after.cpp | sed 1,2d >"$work/real" || true
sed -n '/^```diff$/,/^```$/p' "$readme" | sed '1d;/^```$/,$d' >"$work/shown"
diff "$work/shown" "$work/real" || {
  echo "README.md does not show 'diff -U 1 examples/drop_in/before.cpp examples/drop_in/after.cpp'" >&2
  exit 1
}
