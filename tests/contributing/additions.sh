#!/bin/sh
# Counts the files that a new thing touches, as CONTRIBUTING.md says: one of each kind is added to a copy of the sources, and its files are
# counted; then all of them compile. sh additions.sh <sources> <scratch folder> <compiler> <its arguments, a file> <cmake>
# SPDX-License-Identifier: BSD-3-Clause
set -eu
source=$1 work=$2 cxx=$3 arguments=$4 cmake=$5

fail() {
  echo "$*" >&2
  exit 1
}

# keep <sources> <their copy>
keep() {
  rm -rf "$2"
  mkdir -p "$2"
  cp -R "$1/scene" "$1/contact" "$2"
}

# like <file> <its copy> <sed script>
like() {
  sed "$3" "$1" >"$2"
  ! cmp -s "$1" "$2" || fail "$1 has another form"
}

# edit <file> <sed script>
edit() {
  cp "$1" "$work/unedited"
  sed "$2" "$work/unedited" >"$1"
  ! cmp -s "$1" "$work/unedited" || fail "$1 has another form"
}

# The list that <folder>/CMakeLists.txt makes of its sources.
make_list() {
  {
    echo 'function(target_sources)'
    echo 'endfunction()'
    echo 'function(target_include_directories)'
    echo 'endfunction()'
    sed -n '/^function(tether_list/,/^endfunction/p' "$source/cmake/TetherTarget.cmake"
    sed "s/ CONFIGURE_DEPENDS//; s,\${CMAKE_CURRENT_LIST_DIR},$PWD/$1,g" "$1/CMakeLists.txt"
  } >"$work/list.cmake"
  "$cmake" -P "$work/list.cmake"
}

# has <name> <its source> <the list>: they are to compile as one, since most of the time goes into headers that they have in common.
has() {
  printf '#include "%s"\n#include "%s"\n' "$2" "$3" >>all.cpp
  echo "$1" >>names
  grep -q "${1%_*}" ./*.inc "$3" 2>"$work/none" || fail "the list of $3 has no $1"
}

changes() {
  diff -rq "$work/before/scene" scene || true
  diff -rq "$work/before/contact" contact || true
}

# touches <number> <kind>: since the last kind.
touches() {
  count=$(changes | grep -c .) || true
  [ "$count" -eq "$1" ] || fail "a new $2 touches $count files: $(changes)"
  grep -q "^| $2 |.*| $1 |$" "$source/CONTRIBUTING.md" || fail "CONTRIBUTING.md does not say that a new $2 touches $1 files"
  keep . "$work/before"
}

keep "$source" "$work/before"
keep "$source" "$work/copy"
cd "$work/copy"
like scene/src/effects/sleep.cpp scene/src/effects/doze.cpp 's/Sleep/Doze/g; s/(sleep,/(doze,/'
edit scene/src/effects/CMakeLists.txt 's/^  sleep.cpp$/&\n  doze.cpp/'
make_list scene/src/effects
has doze scene/src/effects/doze.cpp scene/src/effects/list.cpp
touches 2 'effect of scenes'

like scene/src/joints/kinds/ball.cpp scene/src/joints/kinds/pivot.cpp 's/Ball/Pivot/g; s/(ball,/(pivot,/; s/::ball/::pivot/'
edit scene/src/joints/CMakeLists.txt 's,kinds/ball.cpp,& kinds/pivot.cpp,'
edit scene/include/tether/scene/joint.hpp 's/universal, planar }/universal, planar, pivot }/; s/"universal", "planar"/&, "pivot"/'
make_list scene/src/joints
has pivot scene/src/joints/kinds/pivot.cpp scene/src/joints/joint_type.cpp
touches 3 'joint of scenes'

like scene/src/record/svg.cpp scene/src/record/xyz.cpp 's/Svg/Xyz/g; s/svg_format/xyz_format/; s/"[.]svg"/".xyz"/; s/"svg"/"xyz"/'
edit scene/src/record/CMakeLists.txt 's/^  svg.cpp$/&\n  xyz.cpp/'
make_list scene/src/record
has xyz scene/src/record/xyz.cpp scene/src/record/formats.cpp
touches 2 'output of runs'

like scene/src/plan/engines/stepping.cpp scene/src/plan/engines/glider.cpp 's/stepping_engine()/glider_engine()/; s/EngineKind::stepping/EngineKind::glider/'
edit scene/src/plan/CMakeLists.txt 's,^  engines/event.cpp,  engines/glider.cpp\n&,'
edit scene/include/tether/scene/scene.hpp 's/smooth, stepping, event }/smooth, stepping, event, glider }/'
edit scene/include/tether/scene/words.hpp 's/"stepping", "event"/&, "glider"/'
make_list scene/src/plan
has glider scene/src/plan/engines/glider.cpp scene/src/plan/engine_type.cpp
touches 4 'engine of scenes'

like contact/src/law/frictionless.hpp contact/src/law/glue.hpp 's/frictionless/glue/g; s/Frictionless/Glue/g'
like contact/src/law/frictionless.cpp contact/src/law/glue.cpp 's/frictionless/glue/g; s/Frictionless/Glue/g'
edit contact/src/law/laws.cpp 's,^#include "law/frictionless.hpp"$,&\n#include "law/glue.hpp",; s/Coulomb, Frictionless>/Coulomb, Frictionless, Glue>/'
edit contact/include/tether/contact/one_contact.hpp '/^enum class Law /,/};/s/frictionless/frictionless, glue/'
has Glue contact/src/law/glue.cpp contact/src/law/laws.cpp
touches 4 'friction law'

for folder in contact/src/stepping/detection scene/src/geometry; do
  like $folder/shapes/sphere.cpp $folder/shapes/pearl.cpp '/^Shape Shape::/,/^}/d; s/Sphere/Pearl/g; s/sphere/pearl/g'
  make_list $folder
done
edit contact/include/tether/contact/shapes.hpp 's/^  mesh$/  mesh,\n  pearl/; s/ShapeKind, 9>/ShapeKind, 10>/
  s/ShapeKind::mesh};/ShapeKind::mesh, ShapeKind::pearl};/'
has pearl_form contact/src/stepping/detection/shapes/pearl.cpp contact/src/stepping/detection/shape_form.cpp
has pearl_type scene/src/geometry/shapes/pearl.cpp scene/src/geometry/shape_type.cpp
touches 3 'kind of shape'

"$cxx" -O0 -w -I. -Iscene/src -Iscene/include -Icontact/src -Icontact/include "@$arguments" -c all.cpp -o "$work/all.o"
nm -C "$work/all.o" >"$work/symbols"
while read -r name; do
  grep -q " [^U] .*$name" "$work/symbols" || fail "the sources have no $name"
done <names
