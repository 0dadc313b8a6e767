#!/bin/sh
# The price of accuracy, side by side with every peer that the machine has: installs what is missing,
# builds in build/release, runs all comparisons and writes one folder. SPDX-License-Identifier: BSD-3-Clause
#
#   sh benchmarks/run.sh [--quick] [--output DIR] [--contact FOLDER] [--build DIR]
#
#   --quick     fewer problems and tolerances
#   --output    where index.html, results.json and the tables go (default build/benchmarks)
#   --contact   folder of contact problems (fclib files) for contact_collection
#   --build     an existing build directory instead of build/release
#
# Measures with an optimised SUNDIALS: the one in TETHER_SUNDIALS, a prefix, or else the distribution's
# version built with -O3 in build/sundials (once; Debian's own is not optimised). The distribution's has
# a table of its own after it. TETHER_SUNDIALS=none takes the distribution's alone.
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"
quick=no output=build/benchmarks contact=${TETHER_CONTACT_DATA:-} build=
usage() { sed -n '5,10s/^# *//p' "$0" >&2; exit 2; }
while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=yes ;;
    --output) [ $# -gt 1 ] || usage; output=$2; shift ;;
    --contact) [ $# -gt 1 ] || usage; contact=$2; shift ;;
    --build) [ $# -gt 1 ] || usage; build=$2; shift ;;
    *) usage ;;
  esac
  shift
done

sh cmake/install_packages.sh
if [ -z "$build" ]; then
  cmake --preset release >/dev/null
  build=build/release
fi
cmake --build "$build" --parallel "$(nproc)" --target accuracy_cost stability contact_collection contact_cost >/dev/null
# With the tests comes the list of hard cases.
cmake --build "$build" --parallel "$(nproc)" --target hard_cases >/dev/null 2>&1 || true
mkdir -p "$output"
programs=$build/benchmarks

# Programs run with any SUNDIALS of the same soname; for another one they are built again.
optimised=${TETHER_SUNDIALS:-}
if [ -z "$optimised" ]; then
  optimised=$root/build/sundials
  sh benchmarks/optimised_sundials.sh "$optimised" || optimised=none
fi
[ "$optimised" != none ] || optimised=
distribution=$programs
if [ -n "$optimised" ]; then
  [ -d "$optimised/lib" ] || { echo "TETHER_SUNDIALS=$optimised: no folder lib in it" >&2; exit 2; }
  optimised=$(CDPATH='' cd -- "$optimised" && pwd)
  ida=$(ldd "$programs/accuracy/accuracy_cost" | sed -n 's/.*\(libsundials_ida\.so\.[0-9]*\).*/\1/p')
  if [ ! -e "$optimised/lib/$ida" ]; then
    cmake -S . -B build/other_sundials -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$optimised" \
      -DTETHER_BUILD_TESTS=OFF >/dev/null
    cmake --build build/other_sundials --parallel "$(nproc)" \
      --target accuracy_cost stability contact_collection contact_cost >/dev/null
    programs=build/other_sundials/benchmarks
  fi
fi
# Runs a program with the optimised library.
with_optimised() { LD_LIBRARY_PATH="${optimised:+$optimised/lib:}${LD_LIBRARY_PATH:-}" "$@"; }
hard_cases=$build/tests/hard_cases/hard_cases
started=$(date +%s)

cores=$(nproc)  # asked before OMP_NUM_THREADS changes its answer
# One thread for everybody.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

if [ "$quick" = yes ]; then
  accuracy='--count 5 --repeats 1 --seconds 0.1 --no-drift --no-reach --skip four_bar_of'
  again='--count 3 --repeats 1 --seconds 0.1 --no-drift --no-reach --skip four_bar_of,long,chain'
  sweep='--count 20 --problem pendulum,car_axis,andrews --skip long' peers=
else
  accuracy='--count 8 --repeats 3 --seconds 1'
  again='--count 6 --repeats 2 --seconds 0.5 --no-drift --no-reach --skip four_bar_of'
  sweep='--count 100 --skip of_100,of_10,of_5' peers=--peers
fi

# With a second core the rest runs beside accuracy_cost: what is compared is timed within one program.
compare_accuracy() {
  # shellcheck disable=SC2086  # lists of options
  with_optimised "$programs/accuracy/accuracy_cost" $accuracy --csv "$output/accuracy.csv" --svg "$output" \
    --json "$output/accuracy.json" --html "$output/accuracy.part" >"$output/accuracy.txt"
  [ -n "$optimised" ] || return 0
  # shellcheck disable=SC2086
  "$distribution/accuracy/accuracy_cost" $again --csv "$output/accuracy_distribution.csv" \
    --json "$output/accuracy_distribution.json" --html "$output/accuracy_distribution.part" \
    >"$output/accuracy_distribution.txt"
}
beside=
if [ "$cores" -gt 1 ]; then
  compare_accuracy &
  beside=$!
else
  compare_accuracy
fi

echo 'Computational stability'
# shellcheck disable=SC2086
with_optimised "$programs/accuracy/stability" $sweep --csv "$output/stability.csv" --json "$output/stability.json" \
  --html "$output/stability.part" | tee "$output/stability.txt"

echo
echo 'Hard cases'
if [ -x "$hard_cases" ]; then
  # A wrong answer is a row of the page; the test of the same name fails on it.
  # shellcheck disable=SC2086
  "$hard_cases" "$output/hard_cases.md" $peers --html "$output/hard_cases.part" ||
    echo 'hard_cases: not all are right'
else
  echo 'hard_cases left out: the tests are not built (TETHER_BUILD_TESTS)'
fi
touch "$output/hard_cases.part"

echo
contact_text='contact_collection left out: no data folder (--contact FOLDER or TETHER_CONTACT_DATA)'
if [ -n "$contact" ] && [ -d "$contact" ]; then
  # 1e-9 takes seconds on the hardest problems, and Siconos' solvers run into their limit there.
  collection='--time-limit 2 --tolerances 1e-3,1e-6,1e-9'
  [ "$quick" = no ] || collection='--time-limit 0.1 --tolerances 1e-3,1e-6'
  # shellcheck disable=SC2086  # a list of options
  "$programs/contact/contact_collection" "$contact" $collection --csv "$output/contact.csv" \
    >"$output/contact.txt"
  contact_text=$(cat "$output/contact.txt")
fi
echo "$contact_text"

# Scenes quick to run; the full comparison takes all.
scenes='examples/scenes/*.toml' cost='--count 5 --limit 0.3'
[ "$quick" = no ] || scenes='examples/scenes/sliding_block.toml examples/scenes/bouncing_ball.toml
  examples/scenes/icy_wedge.toml' cost='--count 2 --tolerances 1e-3:1e-9 --limit 0.03'
folder=
[ -z "$contact" ] || [ ! -d "$contact" ] || folder=$contact
# shellcheck disable=SC2086  # lists of options and files
"$programs/contact_cost/contact_cost" ${folder:+"$folder"} --scenes $scenes $cost \
  --csv "$output/contact_cost.csv" --svg "$output" --json "$output/contact_cost.json" \
  --html "$output/contact_cost.part" | tee "$output/contact_cost.txt"

[ -z "$beside" ] || wait "$beside"
echo
library=${optimised:+optimised, $optimised}
echo "Error against time, SUNDIALS ${library:-of the distribution}"
cat "$output/accuracy.txt"
if [ -n "$optimised" ]; then
  echo
  echo 'Error against time, SUNDIALS of the distribution'
  sed -n '/^CPU at equal error/,$p' "$output/accuracy_distribution.txt"
fi

# Facts without which times mean nothing.
one_line() { tr '\n' ' ' | tr -d '"\\' | sed 's/  */ /g; s/ *$//'; }
cpu=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1 | one_line)
system=$(uname -srm | one_line)
load=$(cut -d' ' -f1-3 /proc/loadavg 2>/dev/null || echo unknown)
compiler=$(${CXX:-c++} --version 2>/dev/null | head -n 1 | one_line)
commit=$(git rev-parse HEAD 2>/dev/null || echo unknown)
[ -z "$(git status --porcelain 2>/dev/null)" ] || commit="$commit with local changes"
version() { dpkg-query -W -f='${Version}' "$1" 2>/dev/null || echo absent; }
packages=
for package in libsundials-dev libeigen3-dev r-cran-desolve libsimbody-dev libsiconos-numerics-dev; do
  packages="$packages${packages:+, }\"$package\": \"$(version $package)\""
done
seconds=$(($(date +%s) - started))

{
  printf '{"machine": {"cpu": "%s", "cores": %s, "system": "%s", "load": "%s"},\n' \
    "$cpu" "$cores" "$system" "$load"
  printf '"compiler": "%s", "packages": {%s},\n' "$compiler" "$packages"
  printf '"commit": "%s", "date": "%s", "quick": "%s", "seconds": %s,\n' \
    "$commit" "$(date -u +%Y-%m-%dT%H:%M:%SZ)" "$quick" "$seconds"
  printf '"sundials": "%s",\n"accuracy": %s,\n"stability": %s,\n' "${library:-distribution}" \
    "$(cat "$output/accuracy.json")" "$(cat "$output/stability.json")"
  [ -z "$optimised" ] || printf '"accuracy_distribution": %s,\n' \
    "$(cat "$output/accuracy_distribution.json")"
  printf '"contact": %s}\n' "$(cat "$output/contact_cost.json")"
} >"$output/results.json"
rm -f "$output/accuracy.json" "$output/accuracy_distribution.json" "$output/stability.json" "$output/contact_cost.json"

{
  cat <<'HEAD'
<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>Tether: what accuracy costs</title>
<style>body{font-family:sans-serif;max-width:75em;margin:1em auto;padding:0 1em}
table{border-collapse:collapse;font-size:85%;margin:.5em 0}td,th{border:1px solid #ccc;padding:2px 6px;
text-align:right}td:first-child,th:first-child{text-align:left}pre{font-size:80%;overflow:auto}</style>
<h1>What accuracy costs</h1>
HEAD
  printf '<p>%s, %s cores, %s, load %s; %s; commit %s; %s; %s s.</p>\n' "$cpu" "$cores" "$system" \
    "$load" "$compiler" "$commit" "$(date -u +%Y-%m-%d)" "$seconds"
  printf '<p>CPU of one process, dense LU and difference Jacobians in every code. '
  printf 'What each column means: benchmarks/README.md.</p>\n'
  printf '<p>SUNDIALS: %s.</p>\n' "${library:-of the distribution}"
  cat "$output/accuracy.part"
  if [ -n "$optimised" ]; then
    echo '<details><summary>The same with the SUNDIALS of the distribution</summary>'
    cat "$output/accuracy_distribution.part"
    echo '</details>'
  fi
  cat "$output/stability.part" "$output/hard_cases.part"
  printf '<h2>Contact</h2><pre>%s</pre>\n' \
    "$(printf '%s\n' "$contact_text" | sed 's/&/\&amp;/g; s/</\&lt;/g')"
  cat "$output/contact_cost.part"
  echo '</html>'
} >"$output/index.html"
rm -f "$output"/*.part
echo
echo "$seconds s; $output/index.html, $output/results.json, $output/accuracy.csv"
