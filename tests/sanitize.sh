#!/bin/sh
# Tests under sanitizers, in pieces that each fit into the time of a CI job.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/sanitize.sh                      all pieces, one after the other
#   sh tests/sanitize.sh linalg threads       these pieces
#   sh tests/sanitize.sh contact 2/4          the second quarter of the tests of a piece
#   sh tests/sanitize.sh -l                   what the pieces are
#
# linalg, ida_projection, contact, scene: address, leak and undefined-behaviour sanitizer. threads:
# thread sanitizer over the parts that start threads. The first finding ends a test, which then fails.
# Builds in build/sanitize-address and build/sanitize-thread only what a piece needs; -O1 keeps the
# tests at two to four times their usual time. JOBS: parallel jobs (default: all processors).
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"
jobs=${JOBS:-$(nproc)}

pieces='linalg ida_projection contact scene threads'

# Sanitizers, target and tests of a piece. Left out are tests whose measure is lost here, counts of allocations
# and of instructions, and those over MPI ranks, which is not free of leaks itself.
describe() {
  sanitizers=address,undefined
  label="^$1\$"
  target=tests_$1
  tests=.
  case $1 in
    linalg | ida_projection | contact | scene) ;;
    threads)
      sanitizers=thread
      label='^contact$'
      target=tests_contact
      tests='thread|a moving plate under a heap' ;;
    *)
      echo "tests/sanitize.sh: no piece \"$1\"; the pieces are: $pieces" >&2
      exit 2 ;;
  esac
}

run_piece() {
  describe "$1"
  share=$2
  build=build/sanitize-${sanitizers%%,*}
  start=$(date +%s)
  if [ ! -e "$build/CMakeCache.txt" ] && command -v ninja >/dev/null; then
    export CMAKE_GENERATOR=Ninja
  fi
  cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=RelWithDebInfo -DTETHER_SANITIZERS="$sanitizers" \
    -DCMAKE_CXX_FLAGS_RELWITHDEBINFO='-O1 -g1' -DTETHER_BUILD_BENCHMARKS=ON >"$build.log" 2>&1 ||
    { cat "$build.log"; exit 1; }
  cmake --build "$build" --parallel "$jobs" --target "$target"
  built=$(date +%s)
  # The n-th of m shares of the tests: every m-th, so that long neighbours are spread.
  range=
  if [ -n "$share" ]; then range="-I ${share%/*},,${share#*/}"; fi
  export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=1:allocator_may_return_null=1}"
  export UBSAN_OPTIONS="${UBSAN_OPTIONS:-print_stacktrace=1}"
  export TSAN_OPTIONS="${TSAN_OPTIONS:-halt_on_error=1:second_deadlock_stack=1}"
  # shellcheck disable=SC2086
  ctest --test-dir "$build" -L "$label" -R "$tests" -E 'NOT_BUILT|allocat|instruction_counts|no_contact_code|^projection_mpi|over_ranks' \
    $range --parallel "$jobs" --output-on-failure --no-tests=error --timeout 7200 -Q -O "$build.$1.log" ||
    { grep -A40 -E 'ERROR: |runtime error|WARNING: Thread|FAILED' "$build.$1.log" | head -200; failed="$failed $1"; }
  end=$(date +%s)
  echo "$1${share:+ $share}: $(grep -E 'tests passed|tests failed' "$build.$1.log" || true) ($((built - start)) s to build, $((end - built)) s to run; $build.$1.log)"
}

if [ "${1-}" = -l ]; then
  for piece in $pieces; do
    describe "$piece"
    echo "$piece: -fsanitize=$sanitizers, target $target, tests $tests"
  done
  exit 0
fi
mkdir -p build
failed=
[ $# -gt 0 ] || set -- $pieces
while [ $# -gt 0 ]; do
  piece=$1
  shift
  share=
  case ${1-} in [0-9]*/[0-9]*) share=$1; shift ;; esac
  run_piece "$piece" "$share"
done
[ -z "$failed" ] || { echo "findings in:$failed" >&2; exit 1; }
