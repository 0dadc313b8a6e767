#!/bin/sh
# The tests of the package: sh check.sh <settings> <function below>. SPDX-License-Identifier: BSD-3-Clause
set -eu
here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
# shellcheck disable=SC1090
. "$1"
PATH=$(dirname -- "$cmake"):$PATH  # ctest and cpack of the same CMake

fail() {
  echo "$*" >&2
  exit 1
}

# Shows what a command says only where it fails.
quiet() {
  "$@" >"$work/$what.log" 2>&1 || { tail -n 40 "$work/$what.log" >&2; fail "failed: $*"; }
}

# must_fail <extended regular expression> <command>: it fails and says so.
must_fail() {
  wanted=$1
  shift
  if "$@" >"$work/$what.log" 2>&1; then fail "succeeds: $*"; fi
  tr -s ' \n' ' ' <"$work/$what.log" | grep -qE "$wanted" || { tail -n 40 "$work/$what.log" >&2; fail "does not say '$wanted': $*"; }
}

# build <folder> <cmake's arguments>: configures, builds, runs the tests in it.
build() {
  folder=$work/$1
  shift
  quiet "$cmake" -C "$work/cache.cmake" -B "$folder" "$@"
  quiet "$cmake" --build "$folder"
  quiet "$cmake" -E chdir "$folder" ctest --output-on-failure
}

# Components that one stands on, beside linalg.
stands_on() {
  case $1 in
    reverse_ida) echo ida_projection ;;
    contact_*) echo contact ;;
    scene) echo ida_projection contact ;;
  esac
}

is_one_of() {
  case " $2 " in *" $1 "*) true ;; *) false ;; esac
}

# Prefixes static and shared, from this build and from one with the other kind of library, and
# alone/<component>, that one with those that it stands on.
install() {
  rm -rf "$work/static" "$work/shared" "$work/alone" "$work/tree"
  shared=ON
  if [ "$other" = static ]; then shared=OFF; fi
  # shellcheck disable=SC2086
  build tree -S "$source" -DBUILD_SHARED_LIBS=$shared $parts -DTETHER_BUILD_TESTS=OFF -DTETHER_BUILD_PYTHON=OFF \
    -DTETHER_BUILD_EXAMPLES=OFF -DTETHER_BUILD_BENCHMARKS=OFF
  quiet "$cmake" --install "$build" --prefix "$work/$this"
  quiet "$cmake" --install "$work/tree" --prefix "$work/$other"
  for component in $libraries; do
    parts="linalg $(stands_on "$component") $component"
    for part in $parts; do
      if is_one_of "$part" "$libraries"; then
        quiet "$cmake" --install "$build" --prefix "$work/alone/$component" --component "$part"
      fi
    done
    for library in $libraries; do
      files=$(cd "$work/alone/$component" && find . -name "libtether_$library.*" -o -name "tether-$library-targets.cmake" | wc -l)
      if is_one_of "$library" "$parts"; then
        [ "$files" -ge 2 ] || fail "component $component does not bring $library"
      else
        [ "$files" -eq 0 ] || fail "component $component brings files of $library"
      fi
    done
  done
}

# Wider vectors change how Eigen aligns and allocates, in the programs only.
other_flags() {
  if grep -qs '^flags.* avx512f' /proc/cpuinfo; then echo -mavx512f -mfma
  elif grep -qs '^flags.* avx2' /proc/cpuinfo; then echo -mavx2 -mfma; fi
}

consumer() {
  rm -rf "$work/consumer"
  build consumer -S "$here/consumer" -DPREFIXES="$work" -DCOMPONENTS="$libraries" -DFLAGS="$(other_flags)"
}

# pc <prefix> <arguments>
pc() {
  prefix=$1
  shift
  PKG_CONFIG_PATH=$work/$prefix/$libdir/pkgconfig "$pkg_config" "$@"
}

# The package tether-<component>, as pkg-config spells it.
package_of() {
  echo "tether-$1" | tr _ -
}

# The objects of `consumer` with nothing but a compiler and pkg-config. shellcheck disable=SC2046,SC2086
by_pkg_config() {
  export LD_LIBRARY_PATH="$work/shared/$libdir"
  bin=$work/pkg_config
  rm -rf "$bin"
  mkdir "$bin"
  for component in $libraries; do
    package=$(package_of "$component")
    ida=
    if is_one_of ida_projection "$component $(stands_on "$component")"; then ida="$link_sundials -lsundials_ida"; fi
    quiet "$cxx" -std=c++17 $(pc "alone/$component" --cflags "$package") -E "$here/consumer/$component.cpp"
    main=$work/consumer/alone_$component/use_alone_$component.cpp
    for prefix in "alone/$component" "$other"; do
      program=$bin/${component}_$(dirname "$prefix")
      quiet "$cxx" -o "$program" "$main" $(find "$work/consumer" -path "*object_$component.dir*/$component.cpp.o") \
        $(pc "$prefix" --libs "$package") $ida
      quiet "$program"
    done
    if [ "$component" = ida_projection ]; then
      for prefix in static shared; do
        quiet "$cc" -std=c99 $(pc $prefix --cflags "$package") "$source/examples/drop_in/in_c.c" -o "$bin/in_c_$prefix" \
          $(pc $prefix --libs "$package") $ida -lm
        quiet "$bin/in_c_$prefix"
      done
    fi
  done
}

# For each installed header: its name, the header of Eigen that it reaches, or "-", and whether it reaches export.hpp.
headers_and_eigen() {
  (cd "$work/$this/include" && find tether -name '*.hpp' -o -name '*.h' | sort | xargs awk '
    /^#include </ { split($0, part, /[<>]/); includes[FILENAME] = includes[FILENAME] " " part[2] }
    function reach(name,   list, n, i) {
      if (name in seen) return
      seen[name] = 1
      if (name ~ /^Eigen\//) found[name] = 1
      n = split(includes[name], list, " ")
      for (i = 1; i <= n; ++i) reach(list[i])
    }
    END {
      for (header in includes) {
        split("", seen)
        split("", found)
        reach(header)
        print header, ("Eigen/Geometry" in found ? "Geometry" : "Eigen/Core" in found ? "Core" : "-"), \
          ("tether/export.hpp" in seen ? "export" : "")
      }
    }')
}

# The headers of Eigen that a header reaches are compiled once before it, which saves most of the time.
# shellcheck disable=SC2046,SC2086
headers() {
  flags="-std=c++17 -O0 -w $(pc "$this" --cflags $(for l in $libraries; do package_of "$l"; done))"
  folder=$work/headers
  rm -rf "$folder"
  mkdir "$folder"
  for eigen in Core Geometry; do
    echo "#include <Eigen/$eigen>" >"$folder/$eigen.hpp"
    quiet "$cxx" $flags -x c++-header "$folder/$eigen.hpp" -o "$folder/$eigen.hpp.gch"
  done
  headers_and_eigen | grep -v -e /deal_ii.hpp -e /mpi_rows.hpp >"$folder/list"
  [ "$(wc -l <"$folder/list")" -ge 50 ] || fail "few headers: $(cat "$folder/list")"
  while read -r header eigen _; do
    echo "#include <$header>" >"$folder/one.cpp"
    first=
    if [ "$eigen" != - ]; then first="-include $folder/$eigen.hpp"; fi
    quiet "$cxx" $flags $first -fsyntax-only "$folder/one.cpp"
    case $header in *.h) quiet "$cc" -std=c99 $(pc "$this" --cflags tether-ida-projection) -x c -fsyntax-only "$folder/one.cpp" ;; esac
  done <"$folder/list"
  # Another layout of strings or of containers is refused by what all libraries' functions are declared with.
  for header in linalg ida_projection reverse_ida contact contact/files contact/polyhedra contact_mpi scene; do
    grep -q "^tether/$header.hpp .* export" "$folder/list" || [ ! -e "$work/$this/include/tether/$header.hpp" ] ||
      fail "<tether/$header.hpp> does not include <tether/export.hpp>"
  done
  for macro in _GLIBCXX_USE_CXX11_ABI=0 _GLIBCXX_DEBUG; do
    must_fail "this Tether was built with _GLIBCXX_USE_CXX11_ABI=1 and without _GLIBCXX_DEBUG" \
      "$cxx" $flags -D$macro -E "$work/$this/include/tether/export.hpp"
  done
}

# The libraries show no symbols of Eigen. Of an archive not even inline functions of others.
symbols() {
  for component in $libraries; do
    quiet "$nm" --extern-only --defined-only --format=posix "$work/static/$libdir/libtether_$component.a"
    grep -q tether "$work/$what.log" || fail "libtether_$component.a shows nothing of Tether"
    # The interface may have Eigen's types as arguments.
    if [ -z "$merged" ] && grep ' [WVu] ' "$work/$what.log" | grep -vE '^_Z(T[VIS])?N?K?6tether' | head | grep .; then
      fail "these are shown by libtether_$component.a"
    fi
    quiet "$nm" --dynamic --defined-only --format=posix "$work/shared/$libdir/libtether_$component.so"
    grep -q tether "$work/$what.log" || fail "libtether_$component.so shows nothing of Tether"
    if grep -E '^_Z(T[A-Z]|GV|Z)?N?K?5Eigen[^ ]* [A-Zu] ' "$work/$what.log" | head | grep .; then
      fail "these are shown by libtether_$component.so"
    fi
  done
}

fetch_content() {
  rm -rf "$work/fetch_content"
  build fetch_content -S "$here/container" -DUSE=use_ida_projection -DFETCHCONTENT_SOURCE_DIR_TETHER="$source" \
    -DTETHER_BUILD_CONTACT=OFF '-DTETHER_COMPILED_HERE=src/small_lu.cpp|src/fast/kernels.cpp'
}

# Some sources are compiled as parts of the project all the same, with its flags and folders.
add_subdirectory() {
  rm -rf "$work/add_subdirectory"
  build add_subdirectory -S "$here/container" -DUSE=use_contact_io -DTETHER_SOURCE="$source" -DBUILD_SHARED_LIBS=ON \
    -DTETHER_BUILD_IDA_PROJECTION=OFF -DTETHER_BUILD_CONTACT_MPI=OFF -DCMAKE_DISABLE_FIND_PACKAGE_SUNDIALS=ON \
    -DTETHER_COMPILED_HERE=src/law/coulomb.cpp
}

c_only() {
  for form in static shared; do
    rm -rf "$work/c_only"
    build c_only -S "$here/c_only" -Dtether_ROOT="$work/$form" -DEXAMPLES="$source/examples"
  done
}

# None of the files of linalg and contact includes a header of SUNDIALS or of libraries that need it.
no_sundials() {
  [ "$(find "$source/linalg" "$source/contact" -name '*.[ch]pp' | wc -l)" -ge 100 ] || fail "few sources in $source"
  if grep -rE '^ *# *include *[<"](sun|nvector|idas?/|cvodes?/|kinsol/|arkode/|tether/(ida_projection|reverse_ida))' \
    --include='*.[ch]pp' "$source/linalg" "$source/contact"; then
    fail "these includes need SUNDIALS"
  fi
}

# Every file that names Tether's version names this one.
version() {
  names() { grep -qF -- "$2" "$source/$1" || fail "$1 does not have: $2"; }
  names CITATION.cff "version: $version"
  names CHANGELOG.md "## [$version]"
  names packaging/spack/packages/tether/package.py "version(\"$version\")"
  names packaging/vcpkg/tether/vcpkg.json "\"version\": \"$version\""
  names packaging/conda/meta.yaml "set version = \"$version\""
  names tests/package/consumer/prefix/CMakeLists.txt "find_package(tether ${version%.*} "
}

# Another SUNDIALS than the one that the package was built for, a header that says so, is refused: by
# find_package, at link, at run time and, where no build can serve, by the compiler and the build.
# shellcheck disable=SC2046,SC2086
other_sundials() {
  header=$sundials/sundials/sundials_config.h
  set -- $(sed -n 's/.*SUNDIALS_VERSION "\([0-9]*\)\.\([0-9]*\)\.\([0-9]*\).*/\1 \2 \3/p' "$header")
  major=$1 here_is="$1\\.$2\\.$3" next=$(($1 + 1))
  bits=$(sed -n 's/^#define SUNDIALS_INT\(32\|64\)_T.*/\1/p' "$header")
  other_bits=$((96 - bits))
  rm -rf "$work/other"
  # mock <name> <sed script>: headers that are found before the true ones.
  mock() {
    mkdir -p "$work/other/$1/sundials" "$work/other/$1/ida"
    sed "$2" "$header" >"$work/other/$1/sundials/sundials_config.h"
    if cmp -s "$header" "$work/other/$1/sundials/sundials_config.h"; then fail "sundials_config.h has another form"; fi
    echo '#include_next <ida/ida.h>' >"$work/other/$1/ida/ida.h"
  }
  # find_with <name> <words> <arguments>
  find_with() {
    name=$1 words=$2
    shift 2
    must_fail "$words" "$cmake" -S "$here/other_sundials" -B "$work/other/$name/build" -DCMAKE_DISABLE_FIND_PACKAGE_SUNDIALS=ON \
      -DTETHER_SUNDIALS_INCLUDE_DIR="$work/other/$name" "$@"
  }
  flags="$(pc "$this" --cflags --libs tether-ida-projection) $link_sundials -lsundials_ida -lm"
  program="$cxx -std=c++17 -x c++ $here/consumer/ida_projection.cpp $work/consumer/alone_ida_projection/use_alone_ida_projection.cpp"
  built="built for SUNDIALS $here_is \\(double precision, $bits-bit indices\\), but SUNDIALS"
  export LD_LIBRARY_PATH="$work/$this/$libdir"

  mock next "s/SUNDIALS_VERSION \"$major[0-9.]*/SUNDIALS_VERSION \"$next.0.0/; s/SUNDIALS_VERSION_MAJOR $major/SUNDIALS_VERSION_MAJOR $next/"
  find_with next "$built $next\\.0\\.0 \\(double precision, $bits-bit indices\\) was found" -Dtether_ROOT="$work/$this"
  must_fail "undefined .*tether_built_for_sundials_${next}_double_index$bits" \
    $program -x none -o "$work/other/program" -I"$work/other/next" $flags
  mock index "s/SUNDIALS_INT${bits}_T 1/SUNDIALS_INT${other_bits}_T 1/; s/SUNDIALS_INT${bits}_T\$/SUNDIALS_INT${other_bits}_T/"
  find_with index "$built [0-9.]+ \\(double precision, $other_bits-bit indices\\) was found" -Dtether_ROOT="$work/$this"
  must_fail "undefined .*tether_built_for_sundials_${major}_double_index$other_bits" \
    "$cc" "$source/examples/drop_in/in_c.c" -o "$work/other/program" -I"$work/other/index" $flags

  for precision in single extended; do
    mock $precision "s/SUNDIALS_DOUBLE_PRECISION/SUNDIALS_$(echo $precision | tr a-z A-Z)_PRECISION/"
    must_fail "needs a SUNDIALS in double precision" $program -E -I"$work/other/$precision" $flags
    find_with $precision "SUNDIALS [0-9.]+ \\($precision precision, $bits-bit indices\\) in .*: Tether needs double precision" \
      -DTETHER_SOURCE="$source"
  done

  # The program's own answer stands for that of another shared library.
  cat >"$work/other/version.c" <<END
int SUNDIALSGetVersionNumber(int* a, int* b, int* c, char* d, int e) { *a = $next; *b = 5; *c = 0; return 0 * e * !d; }
END
  quiet "$cc" "$source/examples/drop_in/in_c.c" "$work/other/version.c" -o "$work/other/program" $flags
  must_fail "this is SUNDIALS $next\\.5\\.0, but the plugin was compiled with SUNDIALS $here_is" "$work/other/program"
}

# Made by cpack twice with the same bytes, each with what belongs into it.
debian() {
  export SOURCE_DATE_EPOCH=1700000000
  tree=$work/tree
  if [ "$other" = static ]; then tree=$work/debian; fi
  quiet "$cmake" -C "$work/cache.cmake" -S "$source" -B "$tree" -DBUILD_SHARED_LIBS=ON -DCMAKE_INSTALL_PREFIX=/usr \
    -DCMAKE_SKIP_INSTALL_RPATH=ON -DTETHER_BUILD_PYTHON=OFF -DTETHER_BUILD_TESTS=OFF -DTETHER_BUILD_EXAMPLES=OFF \
    -DTETHER_BUILD_BENCHMARKS=OFF -DTETHER_DEBIAN_PACKAGES=ON -DCPACK_DEBIAN_COMPRESSION_TYPE=gzip
  quiet "$cmake" --build "$tree"
  cd "$tree"
  rm -f ./*.deb
  quiet cpack
  [ "$(find . -maxdepth 1 -name '*.deb' | wc -l)" -eq 3 ] || fail "three packages were expected: $(ls ./*.deb)"
  sha256sum ./*.deb >"$work/sums"
  quiet cpack
  sha256sum -c --quiet "$work/sums" || fail "a package has other bytes when it is made again"

  # has <package> <extended regular expression> ...: of its control file and of names of its files.
  has() {
    package=$1
    shift
    { dpkg-deb --info "$package"_"$version"_*.deb && dpkg-deb --contents "$package"_"$version"_*.deb; } >"$work/$what.log"
    for wanted in "$@"; do
      grep -qE "$wanted" "$work/$what.log" || { cat "$work/$what.log" >&2; fail "$package has no $wanted"; }
    done
  }
  for package in libtether libtether-dev tether; do
    has $package "Package: $package\$" "Version: $version\$" "doc/$package/copyright" "doc/$package/changelog.gz"
  done
  for library in $libraries; do
    [ "$library" != contact_mpi ] || continue
    has libtether "libtether_$library[.]so[.]${version%.*} ->"
    if grep -E "libtether_$library[.]so ->|usr/include" "$work/$what.log"; then fail "libtether has files for developers"; fi
    has libtether-dev "libtether_$library[.]so ->" "tether-$library-targets[.]cmake"
  done
  has libtether triggers shlibs
  has libtether-dev "Depends: libtether \\(= $version\\).*libeigen3-dev" usr/include/tether/ pkgconfig/tether-linalg[.]pc
  has tether "Depends: .*libtether \\(= $version\\)" 'usr/bin/tether$' 'man1/tether[.]1[.]gz' 'completions/tether$'
  if [ -n "$lintian" ]; then quiet "$lintian" --fail-on error --allow-root ./*.deb; fi
}

what=$2
"$what"
