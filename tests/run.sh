#!/bin/sh
# All tests: installs missing packages, builds all but the programs of benchmarks/ in build/release and
# runs ctest.
# Arguments go to ctest, e.g. -R projection. SPDX-License-Identifier: BSD-3-Clause
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"

sh cmake/install_packages.sh
if [ ! -e build/release/CMakeCache.txt ] && command -v ninja >/dev/null; then
  export CMAKE_GENERATOR=Ninja  # waits for no library where a source can be compiled
fi
cmake --preset release -DTETHER_BUILD_BENCHMARKS=OFF
cmake --build --preset release --parallel "$(nproc)"
exec ctest --preset release --parallel "$(nproc)" "$@"
