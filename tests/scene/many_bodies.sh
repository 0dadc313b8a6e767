#!/bin/sh
# A scene of a hundred thousand bodies is read with 180 MB of data: 145 here (233 before files were read in pieces),
# 132 (200) where one body stands for all. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/many_bodies.sh PROGRAM
set -eu

program=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

body='shape = "sphere"\nradius = 0.4\nmass = 1.0\nmaterial = "stone"\n'
pair='\n[[pair]]\nbetween = ["stone", "stone"]\nfriction = 0.4\n'
awk -v body="$body" -v pair="$pair" 'BEGIN {
  for (k = 0; k < 100000; ++k)
    printf "[[body]]\nname = \"ball %d\"\nposition = [%d.25, %d, %d]\n%s\n", k, k % 50, k / 50 % 50, k / 2500, body
  printf "%s", pair
}' >each.toml
printf '[[body]]\nname = "ball"\nposition = [0, 0, 0]\n%brepeat = [{ count = 250, step = [1, 0, 0] }, { count = 400, step = [0, 1, 0] }]\n%b' \
  "$body" "$pair" >repeated.toml

ulimit -d 180000 # kB
for scene in each repeated; do
  "$program" plan $scene.toml >said
  grep -q '100000, 100000 of them moving' said || { cat said; exit 1; }
done
