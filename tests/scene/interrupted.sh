#!/bin/sh
# Ctrl-C and SIGTERM: the run exits with 128 and the signal, leaves whole files and a state to go on from. Each
# signal comes twice at once, as timeout(1) and supervisors of process groups send it.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/interrupted.sh PROGRAM SCENE
set -eu

program=$1 scene=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
die() {
  echo "SIG$signal: $1"
  cat "$work/said"
  exit 1
}
commas() { tr -cd , | wc -c; }

for case in INT:130 TERM:143 INT:130 TERM:143; do
  signal=${case%:*} wanted=${case#*:}
  rm -rf "$work/out"
  # It runs for minutes if nothing stops it.
  "$program" run "$scene" --quiet --output "$work/out" --csv a.csv --vtk f.pvd --state a.state --end 100000 \
    --every 0.1 >"$work/said" 2>&1 &
  child=$!
  until grep -q '^0\.5,' "$work/out/a.csv" 2>/dev/null; do
    kill -0 "$child" 2>/dev/null || die "the run ended by itself"
    sleep 0.05
  done
  kill -s "$signal" "$child" && kill -s "$signal" "$child" 2>/dev/null || true
  code=0
  wait "$child" || code=$?
  [ "$code" -eq "$wanted" ] || die "exit code $code, expected $wanted"
  end=$(sed -n 's/^interrupted at \([0-9.e+]*\) s .*/\1/p' "$work/said")
  [ -n "$end" ] || die "no word of the interruption"
  [ -s "$work/out/a.state" ] || die "no state"
  columns=$(grep -m 1 '^time_s' "$work/out/a.csv" | commas)
  [ "$(tail -n 1 "$work/out/a.csv" | commas)" -eq "$columns" ] || die "a cut table"
  [ "$(tail -n 1 "$work/out/f.pvd")" = "</VTKFile>" ] || die "a cut film"
  code=0
  "$program" run "$scene" --quiet --restart "$work/out/a.state" --end "$((${end%%[.e]*} + 1))" >"$work/said" 2>&1 ||
    code=$?
  [ "$code" -le 1 ] || die "the restart exits with $code"
done
# A run that waits for a state from a pipe that nobody writes: the first signal ends it.
mkfifo "$work/never_written"
signal=INT
"$program" run "$scene" --quiet --restart "$work/never_written" >"$work/said" 2>&1 &
child=$!
left=200  # looks; a signal at every 50th of them: the first one may come before the program listens
while kill -0 "$child" 2>/dev/null && [ $left -gt 0 ]; do
  left=$((left - 1))
  sleep 0.1
  [ $((left % 50)) -ne 45 ] || kill -s INT "$child" 2>/dev/null || true
done
[ $left -gt 0 ] || { kill -s KILL "$child"; die "a run that waits for a state does not hear"; }
code=0
wait "$child" || code=$?
[ "$code" -eq 130 ] || die "waiting for a state: exit code $code"
grep -q 'was waited for' "$work/said" || die "not said why"
# A state through a pipe is one.
"$program" run "$scene" --quiet --end 0.1 --state "$work/piped" >"$work/said" 2>&1 || [ $? -eq 1 ] || die "no state"
cat "$work/piped" >"$work/never_written" &
"$program" run "$scene" --quiet --end 0.2 --restart "$work/never_written" >"$work/said" 2>&1 || [ $? -eq 1 ] ||
  die "a state through a pipe"
# A run that waits for a reader of one of its files: before its first step, at its end, and where the signal came before.
for option in csv svg html; do
  mkfifo "$work/unread.$option"
  "$program" run "$scene" --quiet --end 0.05 --$option "$work/unread.$option" >"$work/said" 2>&1 &
  child=$!
  sleep 1
  kill -s TERM "$child" || die "$option: a run does not wait for a reader: $(cat "$work/said")"
  left=50
  while kill -0 "$child" 2>/dev/null && [ $left -gt 0 ]; do
    left=$((left - 1))
    sleep 0.2
  done
  [ $left -gt 0 ] || { kill -s KILL "$child"; die "$option: a run that waits for a reader does not hear"; }
  code=0
  wait "$child" || code=$?
  [ "$code" -eq 143 ] || die "$option: waiting for a reader: exit code $code"
  cat "$work/unread.$option" >"$work/read" &
  "$program" run "$scene" --quiet --end 0.05 --$option "$work/unread.$option" >"$work/said" 2>&1 || [ $? -eq 1 ] ||
    die "$option: a pipe: $(cat "$work/said")"
  wait
  [ -s "$work/read" ] || die "$option: nothing came through a pipe"
done
echo "interrupted runs leave whole files"
