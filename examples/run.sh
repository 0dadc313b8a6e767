#!/bin/sh
# The main job: installs what is missing, builds in build/release and runs examples/pendulum.
# Arguments go to the program. SPDX-License-Identifier: BSD-3-Clause
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"

sh cmake/install_packages.sh
cmake --preset release
cmake --build --preset release --parallel "$(nproc)" --target pendulum
exec build/release/examples/pendulum/pendulum "$@"
