#!/bin/sh
# No command writes over what it reads, whatever the name: the file itself, a second name of it, a name that is only
# used on the way, a mesh that the scene reads. Nor over a file that Tether did not write, unless it is forced; and what
# it writes is run by no other program.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/inputs.sh PROGRAM ROBOT
set -u

program=$(realpath "$1") robot=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
wrong=0 tried=0

# refused FILE ARGUMENTS...: exit code 2 at once, and the file stays as it is.
refused() {
  file=$1
  shift
  tried=$((tried + 1))
  before=$(cksum <"$file")
  timeout -s KILL 60 "$program" "$@" >said 2>&1
  code=$?
  [ $code -eq 2 ] || { echo "$*: exit code $code"; cat said; wrong=1; }
  [ -f "$file" ] && [ "$(cksum <"$file")" = "$before" ] || { echo "$*: $file is lost"; wrong=1; make; }
}

make() {
  rm -rf ./* && mkdir out
  "$program" new pendulum s.toml >/dev/null
  printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >m.obj
  cat >mesh.toml <<'END'
[[body]]
shape = "sphere"
radius = 0.1
mass = 1
[[body]]
shape = "mesh"
fixed = true
file = "m.obj"
END
  for name in a.new a.lock; do cp s.toml $name; done
  ln s.toml hard
  ln m.obj hard_mesh
  cp "$robot" robot
  cp "$robot" b.new
}

make
for option in csv svg html certificate state; do
  refused s.toml run s.toml --quiet --$option s.toml
  refused s.toml run s.toml --quiet --$option hard
  refused a.lock run a.lock --quiet --$option a
  refused m.obj run mesh.toml --quiet --$option m.obj
  refused m.obj run mesh.toml --quiet --$option hard_mesh
done
refused s.toml run s.toml --quiet --vtk hard
for option in svg html state; do refused a.new run a.new --quiet --$option a; done
for option in csv svg html; do
  for name in s.toml hard; do refused s.toml cost s.toml --tolerances 1e-3 --reference 1e-4 --$option $name; done
  refused a.new cost a.new --tolerances 1e-3 --reference 1e-4 --$option a
done
for name in s.toml hard; do refused s.toml sweep s.toml --quiet --vary smooth.tolerance=1e-3 --out $name; done
refused a.new sweep a.new --quiet --vary smooth.tolerance=1e-3 --out a
refused m.obj sweep mesh.toml --quiet --vary body.1.mass=1 --out hard_mesh
refused robot import robot --out robot
refused robot import robot --out robot --force
refused b.new import b.new --out b
refused b.new import b.new --out b --force
# Somebody else's file in the way of one that is made without --force.
refused b.new new pendulum b
refused b.new import robot --out b
# A scene's own names.
printf '[output]\ncsv = "m.obj"\n' >>mesh.toml
refused m.obj run mesh.toml --quiet

# A pipe, or a second name of a file, where a file is made on the way: neither opened nor written into.
for name in x.svg x.state f.pvd; do
  option=${name#*.}
  [ $option = pvd ] && option=vtk
  mkfifo out/$name.new
  timeout -s KILL 60 "$program" run s.toml --quiet --end 0.1 --output out --$option $name >said 2>&1
  code=$?
  [ $code -le 1 ] && [ -s out/$name ] || { echo "a pipe $name.new: exit code $code"; cat said; wrong=1; }
  rm -rf out && mkdir out && ln s.toml out/$name.new
  before=$(cksum <s.toml)
  timeout -s KILL 60 "$program" run s.toml --quiet --end 0.1 --output out --$option $name >said 2>&1
  [ "$(cksum <s.toml)" = "$before" ] || { echo "a second name $name.new: the scene is lost"; wrong=1; make; }
  rm -rf out && mkdir out
done
mkdir out/f && mkfifo out/f/bodies_000000.vtp
timeout -s KILL 60 "$program" run s.toml --quiet --end 0.1 --every 0.05 --output out --vtk f.pvd >said 2>&1 ||
  { [ $? -eq 1 ] || { echo "a pipe among the frames"; cat said; wrong=1; }; }
rm -rf out && mkdir -p out/f && ln s.toml out/f/bodies_000001.vtp
refused s.toml run s.toml --quiet --end 0.1 --every 0.05 --output out --vtk f.pvd
rm -rf out && mkdir -p out/f

# Files of somebody else stay, under each name of an output, by the scene and by the command line; those of Tether are
# replaced as often as one likes, by those of the same kind and of others.
cat >ball.toml <<'END'
[scene]
end = 0.1
gravity = [0, 0, -9.81]
engine = "event"
[output]
csv = "b.csv"
vtk = "b.pvd"
svg = "b.svg"
state = "b.state"
every = 0.05
forces = true
[[body]]
name = "floor"
fixed = true
shape = "plane"
material = "m"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.12]
material = "m"
[[pair]]
between = ["m", "m"]
END
own="run ball.toml --quiet --html b.html"
again() {
  "$program" "$@" >said 2>&1 || [ $? -eq 1 ] || { echo "$* a second time: $(cat said)"; wrong=1; }
}
again $own
again $own
again run ball.toml --quiet --restart b.state --end 0.2
for name in b.csv b.events.csv b.contacts.csv b.pvd b.svg b.state b.html b/bodies_000001.vtp b.svg.new b.csv.lock; do
  [ -f $name ] && mv $name kept
  echo 'what: ; touch PWNED' >$name
  refused $name $own
  [ $name = b.csv.lock ] || again $own --force
  rm -f $name
done
again $own
: >b.csv
again $own
for option in csv svg html; do
  echo mine >c.$option
  refused c.$option cost s.toml --tolerances 1e-3 --reference 1e-4 --$option c.$option
  again cost s.toml --tolerances 1e-3 --reference 1e-4 --$option c.$option --force
  again cost s.toml --tolerances 1e-3 --reference 1e-4 --$option c.$option
done
echo mine >d.csv
refused d.csv sweep s.toml --quiet --vary smooth.tolerance=1e-3 --out d.csv
again sweep s.toml --quiet --vary smooth.tolerance=1e-3 --out d.csv --force
again sweep s.toml --quiet --vary smooth.tolerance=1e-3 --out d.csv
echo 'time_s,x,y' >e.csv
refused e.csv run s.toml --quiet --csv e.csv

# Names that make and shells would obey are refused before anything is written.
mkdir hostile
for line in 'csv = "GNUmakefile"' 'csv = "Makefile"' 'csv = ".bashrc"' 'state = ".envrc"' 'svg = ".git/hooks/x.svg"' \
  'csv = "a/.b/c.csv"' 'vtk = "makefile"'; do
  sed "s,^csv = .*,$line," ball.toml | grep -v '^\(vtk\|svg\|state\) = "b' >hostile/scene.toml
  refused hostile/scene.toml run hostile/scene.toml --quiet --output hostile
done
for name in '$(shell touch PWNED)' '`touch PWNED`' 'a;touch PWNED' 'x!=touch PWNED'; do
  sed "s,^name = \"ball\",name = \"$name\"," ball.toml >hostile/scene.toml
  refused hostile/scene.toml run hostile/scene.toml --quiet --output hostile
done
[ "$(ls -A hostile)" = scene.toml ] || { echo "written: $(ls -A hostile)"; wrong=1; }
if command -v make >/dev/null; then
  (make; cd hostile && make) >/dev/null 2>&1
  [ ! -e PWNED ] && [ ! -e hostile/PWNED ] || { echo "make runs what a scene has written"; wrong=1; }
fi

[ $wrong -eq 0 ] && echo "$tried commands leave what they read"
exit $wrong
