#!/bin/sh
# The tests with other compilers, checks, SUNDIALS and machines: what fits here, and why the rest does
# not. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/matrix.sh                                 all rows that can be run here
#   sh tests/matrix.sh clang assertions                these rows
#   sh tests/matrix.sh --sundials DIR [--sundials DIR2] sundials      against other installations
#   sh tests/matrix.sh -l                              what the rows are
#
# QUICK=1: of rows that run all tests only those of a few seconds. JOBS: parallel jobs (default: all processors). Builds in
# build/matrix/<row>; each row ends as "ran", "FAILED" or "skipped: why".
set -u

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root" || exit 1
jobs=${JOBS:-$(nproc)}
rows='gcc clang assertions sanitizers threads scalar qemu mpi sundials'
# Fuzzing of files, killing and mutation of the processor take the time of all others.
left_out='instruction_counts|no_contact_code'
quick='linalg|builders|bad|criterion|one contact|minimum|projection_(faults|options|consistency|gradients)|stepping:|scene_files|fuzz'
results= folders= wanted= failed=0

note() {
  results="$results
$(printf '%-22s %s' "$1" "$2")"
}
have() { command -v "$1" >/dev/null 2>&1; }

# build_and_test <row> <ctest -R> <cmake arguments ...>
build_and_test() {
  row=$1 tests=$2
  shift 2
  build=build/matrix/$row
  mkdir -p "$build"
  if [ -n "${QUICK:-}" ] && [ "$tests" = . ]; then tests=$quick; fi
  echo "== $row: $*"
  if ! cmake -S . -B "$build" "$@" >"$build/configure.log" 2>&1; then
    tail -5 "$build/configure.log"
    note "$row" "FAILED to configure ($build/configure.log)"
    failed=1
  elif ! cmake --build "$build" --parallel "$jobs" >"$build/build.log" 2>&1; then
    grep -E 'error|Error' "$build/build.log" | head -5
    note "$row" "FAILED to build ($build/build.log)"
    failed=1
  elif ! ctest --test-dir "$build" -R "$tests" -E "$left_out" --parallel "$jobs" --no-tests=error --output-on-failure -Q \
    -O "$build/test.log"; then
    note "$row" "FAILED: $(grep -E 'tests (passed|failed)' "$build/test.log") ($build/test.log)"
    failed=1
  else
    note "$row" "ran: $(grep -E 'tests passed' "$build/test.log")"
  fi
}

describe() {
  cat <<'END'
gcc         g++, all tests, each source by itself, a warning is an error
clang       clang++, all tests
assertions  assertions of Eigen and of the standard library, all tests
sanitizers  addresses, leaks, undefined behaviour (tests/sanitize.sh)
threads     what starts threads under the thread sanitizer (tests/sanitize.sh)
scalar      contact and scenes without vector instructions
qemu        contact on a processor without AVX2 (qemu-user)
mpi         rows and gradients over processes
sundials    projection and problems against other SUNDIALS: --sundials DIR
END
}

row_gcc() {
  have g++ || { note gcc 'skipped: no g++'; return; }
  build_and_test gcc . -DCMAKE_CXX_COMPILER=g++ -DCMAKE_C_COMPILER=gcc -DCMAKE_BUILD_TYPE=Release -DTETHER_WARNINGS_AS_ERRORS=ON \
    -DTETHER_UNITY_BUILD=OFF
}

row_clang() {
  have clang++ || { note clang 'skipped: no clang++'; return; }
  build_and_test clang . -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_C_COMPILER=clang -DCMAKE_BUILD_TYPE=Release
}

# Assertions of Eigen and of the standard library; -O0 takes twenty times as long and asserts no more.
row_assertions() {
  build_and_test assertions . -DCMAKE_BUILD_TYPE=RelWithDebInfo '-DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -g1' \
    -DCMAKE_CXX_FLAGS=-D_GLIBCXX_ASSERTIONS
}

row_sanitizers() {
  if sh tests/sanitize.sh linalg ida_projection contact scene; then note sanitizers ran; else note sanitizers FAILED; failed=1; fi
}

row_threads() {
  if sh tests/sanitize.sh threads; then note threads ran; else note threads FAILED; failed=1; fi
}

# The code for processors without AVX2, on any machine.
row_scalar() {
  build_and_test scalar 'contact:|stepping|scene' -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS=-DTETHER_GROUPS=0
}

row_qemu() {
  have qemu-x86_64 || { note qemu 'skipped: no qemu-x86_64 (Debian qemu-user); row scalar has the same code'; return; }
  build_and_test qemu 'contact:(body|criterion|spheres|stepping: inc)' -DCMAKE_BUILD_TYPE=Release \
    '-DCMAKE_CROSSCOMPILING_EMULATOR=qemu-x86_64;-cpu;Nehalem' -DCMAKE_SYSTEM_NAME=Linux
}

row_mpi() {
  { have mpicxx && have mpiexec; } || { note mpi 'skipped: no MPI'; return; }
  build=build/matrix/mpi
  mkdir -p "$build"
  if cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=Release -DTETHER_BUILD_CONTACT=OFF \
    -DTETHER_BUILD_SCENE=OFF >"$build/configure.log" 2>&1 && cmake --build "$build" --parallel "$jobs" --target gradients_mpi rows_mpi \
    >"$build/build.log" 2>&1 && ctest --test-dir "$build" -R 'projection_mpi: (gradients|dist)' -V -O "$build/test.log" >/dev/null; then
    note mpi "ran: $(grep -o '[0-9]* ranks: .*' "$build/test.log")"
  elif ! [ -e "$build/build.log" ]; then
    note mpi "skipped: no SUNDIALS with MPI vectors ($build/configure.log)"
  else
    note mpi "FAILED ($build)"
    failed=1
  fi
}

row_sundials() {
  [ -n "$folders" ] || { note sundials 'skipped: no --sundials DIR; benchmarks/optimised_sundials.sh makes one'; return; }
  for folder in $folders; do
    name=sundials_$(basename "$folder")
    [ -d "$folder/include" ] || { note "$name" "skipped: no $folder/include"; continue; }
    build_and_test "$name" 'projection|problems|hard|sundials_examples' -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$folder" \
      -DTETHER_BUILD_CONTACT=OFF -DTETHER_BUILD_SCENE=OFF
  done
}

while [ $# -gt 0 ]; do
  case $1 in
    -l) describe; exit 0 ;;
    --sundials) folders="$folders $2"; shift ;;
    *) case " $rows " in *" $1 "*) wanted="$wanted $1" ;; *) echo "no row \"$1\"; rows: $rows" >&2; exit 2 ;; esac ;;
  esac
  shift
done
for each in ${wanted:-$rows}; do "row_$each"; done
echo "$results"
exit $failed
