#!/bin/sh
# Fails when a source file differs from what .clang-format makes of it; names the files.
# Exit code 77: skipped, since versions of clang-format differ in what they do and 14 is not here.
# SPDX-License-Identifier: BSD-3-Clause
set -eu

cd "$(dirname -- "$0")/.."
format=$(command -v clang-format-14 || command -v clang-format || true)
case $([ -n "$format" ] && "$format" --version) in
  *version\ 14.*) ;;
  *) echo "skipped: clang-format 14 is not installed"; exit 77 ;;
esac

find linalg ida_projection contact scene tests benchmarks examples cmake -type d -name 'build*' -prune -o \
  -type f \( -name '*.cpp' -o -name '*.hpp' -o -name '*.h' \) -print0 |
  xargs -0 "$format" --style=file --dry-run --Werror || {
    echo "format them with: $format -i FILE" >&2
    exit 1
  }
