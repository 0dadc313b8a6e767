#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
set -eu
cmake -S "$SRC_DIR" -B build -G Ninja $CMAKE_ARGS -DCMAKE_BUILD_TYPE=Release -DBUILD_SHARED_LIBS=ON \
  -DTETHER_BUILD_CONTACT_MPI=OFF -DTETHER_BUILD_PYTHON=OFF -DTETHER_BUILD_TESTS=OFF \
  -DTETHER_BUILD_EXAMPLES=OFF -DTETHER_BUILD_BENCHMARKS=OFF
cmake --build build --parallel "${CPU_COUNT:-2}"
cmake --install build
