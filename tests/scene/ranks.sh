#!/bin/sh
# Runs over MPI ranks: the bytes of one process, and errors of one that end all.
# ranks.sh PROGRAM MPIEXEC FLAG-FOR-THE-NUMBER SMOOTH-SCENE. SPDX-License-Identifier: BSD-3-Clause
set -eu
program=$1 mpiexec=$2 flag=$3 smooth=$4
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_mpi_yield_when_idle=1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
fail() { echo "FAILED: $*"; exit 1; }
over() { ranks=$1; shift; "$mpiexec" "$flag" "$ranks" "$program" run "$@"; }

# A block of spheres that touch, one island, set moving at a corner; boxes that drop on the floor
# beside it, islands of their own, and a door on a hinge.
awk 'BEGIN {
  print "[scene]\nname = \"heap\"\nend = 0.004\ngravity = [0, 0, -9.81]"
  print "[stepping]\nstep = 0.001\ntolerance = 1e-4\non_failure = \"warn\""
  print "[output]\nevery = 0.001"
  print "[[pair]]\nbetween = [\"stone\", \"stone\"]\nfriction = 0.4\nrestitution = 0.3"
  print "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"stone\""
  for (i = 0; i < 10; ++i) for (j = 0; j < 10; ++j) for (k = 0; k < 7; ++k) {
    printf "[[body]]\nname = \"ball %d %d %d\"\nshape = \"sphere\"\nradius = 0.05\nmass = 1\n", i, j, k
    printf "material = \"stone\"\nposition = [%.17g, %.17g, %.17g]\n", 0.1 * i, 0.1 * j, 0.05 + 0.1 * k
    if (i + j + k == 0) print "velocity = [1, 0.5, 0]"
  }
  for (i = 0; i < 20; ++i) {
    printf "[[body]]\nname = \"box %d\"\nshape = \"box\"\nsize = [0.1, 0.1, 0.1]\nmass = 1\n", i
    printf "material = \"stone\"\nposition = [%.17g, -3, 0.051]\nvelocity = [0.1, 0, -1]\n", 0.3 * i
  }
  print "[[body]]\nname = \"door\"\nshape = \"box\"\nsize = [0.5, 0.02, 1]\nmass = 2"
  print "position = [0.25, 5, 1]\nangular_velocity = [0, 0, 1]"
  print "[[joint]]\nname = \"hinge\"\nkind = \"hinge\"\nbodies = [\"door\", \"world\"]\nat = [0, 5, 1]\naxis = [0, 0, 1]"
}' > heap.toml
# Points in the frame f/bodies_NUMBER of a film, in however many pieces.
points() { grep -a -o 'NumberOfPoints="[0-9]*"' "$@" | sed 's/.*="//; s/"//' | awk '{ n += $1 } END { print n }'; }
"$program" run heap.toml --quiet --csv one.csv --state one.state --vtk one.pvd > one.log || fail "one process: $(cat one.log)"
for ranks in 2 3; do
  over $ranks heap.toml --quiet --csv $ranks.csv --state $ranks.state --vtk $ranks.pvd > $ranks.log 2>&1 ||
    fail "$ranks ranks: $(cat $ranks.log)"
  cmp one.csv $ranks.csv || fail "$ranks ranks: another table"
  cmp one.state $ranks.state || fail "$ranks ranks: another state"
  [ "$(grep -c 'stepping engine' $ranks.log)" = 1 ] || fail "$ranks ranks: not one summary: $(cat $ranks.log)"
  # A film in pieces, one of each process, with all bodies and contacts.
  [ "$(grep -c '\.pvtp"' $ranks.pvd)" = "$(grep -c '\.vtp"' one.pvd)" ] || fail "$ranks ranks: $(cat $ranks.pvd)"
  for what in bodies contacts; do
    [ "$(grep -c '<Piece ' $ranks/${what}_000004.pvtp)" = $ranks ] || fail "$ranks ranks: pieces of $what"
    [ "$(points $ranks/${what}_000004_p*.vtp)" = "$(points one/${what}_000004.vtp)" ] ||
      fail "$ranks ranks: another number of points of $what"
  done
  grep -q "$ranks processes, which shared [1-9]" $ranks.log || fail "$ranks ranks shared nothing"
done

# Wrong for all, wrong for the one that writes, and not for several at all.
refused() {
  text=$1; shift
  code=0
  over 2 "$@" > refused.log 2>&1 || code=$?
  [ "$code" = 2 ] || fail "$*: exit code $code: $(cat refused.log)"
  [ "$(grep -c "^tether: .*$text" refused.log)" = 1 ] || fail "$*: not said once: $(cat refused.log)"
}
refused "engine \"smooth\", in one process" "$smooth" --quiet
refused "nowhere.toml" nowhere.toml --quiet
refused "give the scene's file" -
mkdir file.csv
refused "file.csv" heap.toml --quiet --csv file.csv
echo "runs over ranks: all as they should"
