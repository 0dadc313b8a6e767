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
echo "interrupted runs leave whole files"
