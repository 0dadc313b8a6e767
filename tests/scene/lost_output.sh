#!/bin/sh
# Full disks, limits of file sizes, closed pipes and closed descriptors: never exit code 0 with
# something lost, never a death by signal in the middle, never a state that is cut.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/lost_output.sh PROGRAM SCENE
set -u

program=$1 scene=$2
work=$(mktemp -d)
trap 'umount "$work/small" 2>/dev/null; rm -rf "$work"' EXIT
wrong=0
run() { "$program" run "$scene" --end 0.5 --quiet "$@"; }
# wanted <code> <got> <what>
wanted() {
  [ "$1" -eq "$2" ] && return
  echo "$3: exit code $2, expected $1"
  cat "$work/said" 2>/dev/null
  wrong=1
}

if [ -e /dev/full ]; then
  run >/dev/full 2>"$work/said"; wanted 2 $? "summary to a full disk"
  grep -q 'standard output' "$work/said" || { echo "not said: $(cat "$work/said")"; wrong=1; }
  "$program" check "$scene" >/dev/full 2>"$work/said"; wanted 2 $? "check to a full disk"
  "$program" --help >/dev/full 2>"$work/said"; wanted 2 $? "help to a full disk"
  run --csv /dev/full >"$work/said" 2>&1; wanted 2 $? "table on a full disk"
  grep -q 'cannot write /dev/full' "$work/said" || { echo "not said: $(cat "$work/said")"; wrong=1; }
  run 2>/dev/full >"$work/said"; wanted 0 $? "progress to a full disk"
else
  echo "no /dev/full here"
fi

# A limit of file sizes is the full disk that everybody can have: in blocks of 512 or 1024 bytes.
for table in a.csv a.pvd; do
  rm -rf "$work/limited"
  option=--csv
  [ "$table" = a.csv ] || option=--vtk
  (ulimit -f 8; exec "$program" run "$scene" --end 2 --every 0.001 --quiet --output "$work/limited" $option "$table" \
    --state a.state) >"$work/said" 2>&1
  code=$?
  if [ "$option" = --csv ]; then wanted 2 $code "table beyond the limit of file sizes"; fi
  [ $code -le 3 ] || { echo "$table beyond the limit: exit code $code"; wrong=1; }
  rm -f "$work/limited"/*.lock
done

# With a state from before, a disk that is full later leaves that state whole.
run --output "$work/state" --state a.state >"$work/said" 2>&1; wanted 0 $? "the first half"
cp "$work/state/a.state" "$work/before"
(ulimit -f 0; exec "$program" run "$scene" --end 1 --quiet --restart "$work/state/a.state" --state "$work/state/a.state") \
  >/dev/null 2>&1
[ $? -eq 0 ] && { echo "a state that could not be written: exit code 0"; wrong=1; }
cmp "$work/before" "$work/state/a.state" || { echo "a full disk harmed the state before"; wrong=1; }

# A reader that has left, whatever the load: the files are whole, and an error keeps its code.
mkdir "$work/pipe"
mkfifo "$work/fifo"
exec 3<>"$work/fifo" 4>"$work/fifo" 3<&-
run --output "$work/pipe" --csv a.csv --state a.state >&4 2>"$work/said"; wanted 141 $? "a pipe that is closed"
"$program" run "$scene" --end 0.5 --output "$work/pipe" --csv b.csv >/dev/null 2>&4
wanted 0 $? "a closed pipe for the progress"
"$program" check "$work/none.toml" >/dev/null 2>&4; wanted 2 $? "a closed pipe for an error"
exec 4>&-
run --output "$work/pipe" --csv c.csv >/dev/null 2>&1
for table in a.csv b.csv; do
  cmp "$work/pipe/$table" "$work/pipe/c.csv" || { echo "a closed pipe changed a table"; wrong=1; }
done

# Closed descriptors: no file of the run gets their number.
"$program" run "$scene" --end 0.5 --output "$work/pipe" --csv d.csv --state d.state <&- >&- 2>&-
cmp "$work/pipe/d.csv" "$work/pipe/c.csv" || { echo "text was written into a table"; wrong=1; }
# An output that goes nowhere is no success.
for option in csv svg html state; do
  "$program" run "$scene" --end 0.1 --quiet --$option - >&- 2>"$work/said"; wanted 2 $? "--$option - to a closed output"
  grep -q 'standard output' "$work/said" || { echo "not said: $(cat "$work/said")"; wrong=1; }
done

# Memory that ends: said as that. Two thousand balls in one place touch in two million contacts. (A sanitizer needs more
# addresses than the limit leaves.)
{
  printf '[scene]\nend = 1\ngravity = [0, 0, -1]\n[stepping]\nstep = 1e-3\n[[body]]\nname = "b {i}"\nshape = "sphere"\n'
  printf 'radius = 0.1\nmass = 1\nmaterial = "m"\nrepeat = { count = 2000 }\n[[pair]]\nbetween = ["m", "m"]\n'
} >"$work/many.toml"
limited() { (ulimit -v 400000 2>/dev/null && exec "$program" "$@"); }
if limited --version >/dev/null 2>&1; then
  limited run "$work/many.toml" --quiet >"$work/said" 2>&1; wanted 3 $? "memory that ends"
  grep -q 'the memory has ended' "$work/said" || { echo "not said:"; cat "$work/said"; wrong=1; }
fi

# A small file system, where this may be mounted.
mkdir "$work/small"
if mount -t tmpfs -o size=64k tmpfs "$work/small" 2>/dev/null; then
  run --output "$work/small" --csv a.csv --state a.state --every 1e-4 >"$work/said" 2>&1
  wanted 2 $? "a small file system"
  rm -f "$work/small/a.csv"
  run --output "$work/small" --state a.state >"$work/said" 2>&1; wanted 0 $? "after room was made"
  umount "$work/small"
else
  echo "no small file system: needs the right to mount"
fi
[ $wrong -eq 0 ] && echo "lost output is always said"
exit $wrong
