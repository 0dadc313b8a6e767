#!/bin/sh
# A run that is killed (SIGKILL) at random moments and goes on from its last state leaves the files of
# one that was not. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/killed.sh PROGRAM SCENE TIMES [SEED] [OPTION OF run ...]
#
# e.g. sh tests/scene/killed.sh build/release/scene/tether examples/scenes/stack.toml 100 1 --end 4
set -eu

program=$1 scene=$2 times=$3 seed=${4:-1}
shift 3
[ $# -eq 0 ] || shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Records and checkpoints are frequent, so that many a kill hits the writing of a file, and mostly apart, so that
# something lies between them.
go() {
  folder=$1
  shift
  exec "$program" run "$work/scene.toml" --quiet --output "$folder" --csv a.csv --vtk f.pvd --state a.state "$@"
}
{
  awk '/^\[/ { output = /^\[output\]/ } !output' "$scene"
  printf '[output]\nevery = 0.01\ncheckpoint = 0.047\nforces = true\n'
} >"$work/scene.toml"

start=$(date +%s%N)
(go "$work/whole" "$@") >"$work/said" 2>&1 || [ $? -eq 1 ] || { cat "$work/said"; exit 1; }
whole=$((($(date +%s%N) - start) / 1000))  # microseconds

killed=0 state_was_there=0
for round in $(seq "$times"); do
  rm -rf "$work/part"
  tries=0
  while :; do
    restart=
    if [ -e "$work/part/a.state" ]; then
      restart="--restart $work/part/a.state"
      state_was_there=$((state_was_there + 1))
    fi
    # Between nothing and the time of a whole run; at the fifth kill in a row the run may end.
    seed=$(((seed * 1103515245 + 12345) % 2147483648))
    wait_us=$((whole * (seed / 65536 % 1000) / 1000))
    # shellcheck disable=SC2086
    (go "$work/part" $restart "$@") >"$work/said" 2>&1 &
    child=$!
    if [ "$tries" -lt 5 ]; then
      sleep "$(printf '%d.%06d' $((wait_us / 1000000)) $((wait_us % 1000000)))"
      kill -9 "$child" 2>/dev/null || true
    fi
    code=0
    wait "$child" 2>/dev/null || code=$?
    tries=$((tries + 1))
    if [ "$code" -eq 137 ]; then
      killed=$((killed + 1))
      continue
    fi
    [ "$code" -le 1 ] || { echo "round $round, try $tries: exit code $code"; cat "$work/said"; exit 1; }
    break
  done
  rm -f "$work"/part/*.lock "$work"/part/*.new
  diff -rq "$work/whole" "$work/part" || { echo "round $round: other files after $tries tries, seed $seed"; exit 1; }
done
echo "$times runs, $killed kills, $state_was_there restarts: the same files each time"
