#!/bin/sh
# A scene comes with links in its folder that lead out of it: nothing outside is written, whichever of the files of
# a run they stand for. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/links.sh PROGRAM
set -eu

program=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
wrong=0

# try WHAT LINK TARGET OUTPUT
try() {
  rm -rf "$work/home" "$work/here"
  mkdir -p "$work/home" "$work/here"
  echo precious >"$work/home/file"
  cd "$work/here"
  mkdir -p "$(dirname "$2")"
  ln -s "$3" "$2"
  cat >scene.toml <<END
[scene]
engine = "$engine"
end = 0.1
gravity = [0, 0, -1]
[output]
forces = true
$4
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
material = "m"
[[pair]]
between = ["m", "m"]
END
  code=0
  "$program" run scene.toml --quiet >"$work/said" 2>&1 || code=$?
  if [ "$(cat "$work/home/file")" != precious ] || [ "$(ls "$work/home")" != file ] || [ $code -gt 2 ]; then
    echo "$1, $engine: exit code $code, outside lie $(ls "$work/home" | tr '\n' ' ')"
    cat "$work/said"
    wrong=1
  fi
}

for engine in stepping event; do
  home=$work/home
  try "a folder" out "$home" 'csv = "out/a.csv"'
  try "a table" a.csv "$home/file" 'csv = "a.csv"'
  try "a table that is not there" a.csv "$home/new" 'csv = "a.csv"'
  try "the table of contacts" a.contacts.csv "$home/file" 'csv = "a.csv"'
  try "the table of events" a.events.csv "$home/file" 'csv = "a.csv"'
  try "the lock" a.csv.lock "$home/file" 'csv = "a.csv"'
  try "the folder of frames" f "$home" 'vtk = "f.pvd"'
  try "a frame" f/bodies_000000.vtp "$home/file" 'vtk = "f.pvd"'
  try "a frame that is not there" f/bodies_000001.vtp "$home/new" 'vtk = "f.pvd"'
  try "the film" f.pvd "$home/file" 'vtk = "f.pvd"'
  for name in a.svg f.pvd a.state; do
    kind=${name#*.}
    [ $kind = pvd ] && kind=vtk
    try "$name.new" $name.new "$home/file" "$kind = \"$name\""
    try "$name.new that is not there" $name.new "$home/new" "$kind = \"$name\""
  done
done
# A pipe in the folder, which a scene names: neither opened nor waited for.
engine=stepping
for kind in csv svg state; do
  rm -rf "$work/here" && mkdir "$work/here" && cd "$work/here" && mkfifo a.$kind
  printf '[scene]\nend = 0.1\n[output]\n%s = "a.%s"\n[[body]]\nshape = "sphere"\nradius = 1\nmass = 1\n' $kind $kind >scene.toml
  code=0
  timeout -s KILL 60 "$program" run scene.toml --quiet >"$work/said" 2>&1 || code=$?
  [ $code -eq 2 ] && [ -p a.$kind ] || { echo "$kind = a pipe: exit code $code"; wrong=1; }
done
[ $wrong -eq 0 ] && echo "nothing outside the folder is written"
exit $wrong
