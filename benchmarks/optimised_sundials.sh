#!/bin/sh
# Builds the SUNDIALS of the distribution's package with optimisation: same version, same sources, -O3.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh benchmarks/optimised_sundials.sh DIR      DIR/include, DIR/lib
#
# Debian's own is compiled without -O. The sources come by apt-get from lists of their own below DIR:
# the machine's are left as they are, and no rights are needed. Done already: nothing happens.
set -eu

[ $# -eq 1 ] || { sed -n '5p' "$0" | sed 's/^# *//' >&2; exit 2; }
mkdir -p "$1"
dir=$(CDPATH='' cd -- "$1" && pwd)
installed=$(dpkg-query -W -f='${source:Package}=${source:Version}' libsundials-dev)
if [ -f "$dir/built" ] && [ "$(cat "$dir/built")" = "$installed" ]; then exit 0; fi

work=$dir/work
rm -rf "$work" "$dir/built"
mkdir -p "$work/lists/partial" "$work/cache/archives/partial" "$work/sources"
# The machine's Debian archives, as sources.
for file in /etc/apt/sources.list.d/*.sources; do
  [ ! -f "$file" ] || sed '/^#/d; s/^Types:.*/Types: deb-src/' "$file" |
    awk 'BEGIN { RS = ""; ORS = "\n\n" } /URIs:[^\n]*debian/'
done >"$work/sources/debian.sources"
for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.list; do
  [ ! -f "$file" ] || sed -n '/debian/s/^deb /deb-src /p' "$file"
done >"$work/sources/debian.list"
cat >"$work/apt.conf" <<CONF
Dir::Etc::sourcelist "-";
Dir::Etc::sourceparts "$work/sources";
Dir::State::lists "$work/lists";
Dir::Cache "$work/cache";
APT::Sandbox::User "";
CONF
cd "$work"
export APT_CONFIG="$work/apt.conf"
echo "SUNDIALS: fetching the sources of $installed"
apt-get update >apt.log 2>&1 && apt-get source --download-only "$installed" >>apt.log 2>&1 &&
  dpkg-source --no-check -x ./*.dsc source >>apt.log 2>&1 || {
  tail -n 5 apt.log >&2
  echo "SUNDIALS: no sources of $installed (see $work/apt.log); build SUNDIALS yourself with" \
    "-DCMAKE_BUILD_TYPE=Release and set TETHER_SUNDIALS to its prefix" >&2
  exit 1
}

echo "SUNDIALS: building it with -O3 in $dir"
multiarch=$(dpkg-architecture -qDEB_HOST_MULTIARCH 2>/dev/null || gcc -print-multiarch)
cmake -S source -B build -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_FLAGS=-fcommon \
  -DCMAKE_C_FLAGS_RELEASE='-O3 -DNDEBUG' -DCMAKE_INSTALL_PREFIX="$dir" -DCMAKE_INSTALL_LIBDIR=lib \
  -DBUILD_STATIC_LIBS=OFF -DBUILD_ARKODE=OFF -DBUILD_KINSOL=OFF -DENABLE_KLU=ON \
  -DKLU_INCLUDE_DIR=/usr/include/suitesparse -DKLU_LIBRARY_DIR="/usr/lib/$multiarch" \
  -DEXAMPLES_ENABLE_C=OFF -DEXAMPLES_ENABLE_CXX=OFF -DEXAMPLES_INSTALL=OFF >build.log 2>&1 &&
  cmake --build build --parallel "$(nproc)" --target install >>build.log 2>&1 || {
  tail -n 5 build.log >&2
  exit 1
}
cd "$dir"
rm -rf "$work"
echo "$installed" >built
