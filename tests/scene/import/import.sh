#!/bin/sh
# `tether import` as a command: its scenes run, `-` works, what is left out is said, exit codes.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/import/import.sh PROGRAM FOLDER_WITH_ROBOTS
set -u

program=$1 robots=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
wrong=0
complain() { echo "$*"; wrong=1; }
# wanted <code> <what> <command...>
wanted() {
  code=$1 what=$2
  shift 2
  "$@" >said 2>errors
  got=$?
  [ $got -eq "$code" ] || { complain "$what: exit code $got, expected $code"; cat said errors; }
}

for robot in arm.urdf walker.xml; do
  wanted 0 "import $robot" "$program" import "$robots/$robot" --out "$robot.toml"
  grep -q '^left out or changed: ' errors || complain "$robot: nothing said"
  grep -q '^# Left out or changed:' "$robot.toml" || complain "$robot: no comment says so"
  wanted 0 "check $robot" "$program" check "$robot.toml"
  wanted 0 "run $robot" "$program" run "$robot.toml" --quiet --end 0.05
done
wanted 2 "a file that is there" "$program" import "$robots/arm.urdf" --out arm.urdf.toml
grep -q 'is there already' errors || complain "not said"
wanted 0 "by force" "$program" import "$robots/arm.urdf" --out arm.urdf.toml --force
wanted 1 "strict" "$program" import "$robots/arm.urdf" --out strict.toml --strict
[ -f strict.toml ] || complain "strict writes nothing"
sed '1,/^$/d' arm.urdf.toml >body
"$program" import - <"$robots/arm.urdf" 2>errors | sed '1,/^$/d' | cmp - body || complain "- differs"
wanted 0 "to run by a pipe" sh -c "'$program' import '$robots/arm.urdf' | '$program' run - --quiet --end 0.01"
wanted 0 "options" "$program" import "$robots/arm.urdf" --base free --height 1 --ground 0 --friction 0.3 \
  --joint shoulder=0.5 --hold grip --no-joint-laws --end 0.1 --out free.toml
wanted 0 "run free" "$program" run free.toml --quiet
wanted 2 "no file" "$program" import none.urdf
wanted 2 "a joint that is not there" "$program" import "$robots/arm.urdf" --joint none=1
wanted 2 "a position that is none" "$program" import "$robots/arm.urdf" --joint shoulder=nan
wanted 2 "friction below zero" "$program" import "$robots/arm.urdf" --friction -1
wanted 2 "a base that is none" "$program" import "$robots/arm.urdf" --base soft
# Files that a robot names are not opened: a pipe without a writer would be waited for.
mkfifo pipe.stl
cat >meshes.urdf <<END
<robot name='r'><link name='l'>
<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>
<visual><geometry><mesh filename='pipe.stl'/></geometry></visual>
<collision><geometry><mesh filename='file://$work/pipe.stl'/></geometry></collision>
</link></robot>
END
wanted 0 "a robot with meshes" timeout -s KILL 60 "$program" import meshes.urdf --base free --out meshes.toml
echo '<robot>' | "$program" import - 2>&1 | grep -q '^tether: standard input:1: ' || complain "place of an error"
[ $wrong -eq 0 ] && echo "import does what it says"
exit $wrong
