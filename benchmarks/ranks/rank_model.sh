#!/bin/sh
# Sweeps of contact_mpi over 1 to 512 ranks on a cluster that SimGrid simulates: a model, no
# measurement. SPDX-License-Identifier: BSD-3-Clause
#
#   sh benchmarks/ranks/rank_model.sh BUILD [contacts a rank = 5000] [ns a contact and sweep = 15] [ranks ...]
#
# SWEEPS in the environment: how many, 20. BUILD: a build directory with tether_contact. Needs SimGrid (Debian: libsimgrid-dev); without it a
# message says so, exit code 0. The cluster: one rank a node, 100 Gb/s, 1.5 us from node to node
# through a switch that never blocks, 0.3 us of a processor for each message sent and received.
set -eu

build=${1:?"usage: rank_model.sh BUILD [contacts a rank] [ns a contact and sweep] [ranks ...]"}
contacts=${2:-5000} ns=${3:-15}
[ $# -gt 3 ] && shift 3 || set -- 1 2 4 8 16 32 64 128 256 512
root=$(CDPATH='' cd -- "$(dirname -- "$0")/../.." && pwd)
if ! command -v smpicxx >/dev/null || ! command -v smpirun >/dev/null; then
  echo "rank_model: no SimGrid here (apt-get install libsimgrid-dev): skipped"
  exit 0
fi
archive() { find "$build/$1" -maxdepth 2 -name "$2" | head -n 1; }
contact=$(archive contact libtether_contact.a) linalg=$(archive linalg libtether_linalg.a)
[ -n "$contact" ] || { echo "rank_model: no libtether_contact.a in $build" >&2; exit 2; }

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
smpicxx -std=c++17 -O2 -pthread -I"$root/contact/include" -I"$root/contact/src" \
  -I"$root/contact/mpi/include" -I"$root/linalg/include" \
  -I/usr/include/eigen3 \
  "$root/benchmarks/ranks/rank_model.cpp" "$root/contact/mpi/src/messages.cpp" \
  "$contact" $linalg -o "$folder/rank_model"
cat >"$folder/cluster.xml" <<'XML'
<?xml version='1.0'?>
<!DOCTYPE platform SYSTEM "https://simgrid.org/simgrid.dtd">
<platform version="4.1">
  <cluster id="cluster" prefix="node-" suffix="" radical="0-511" speed="1Gf" bw="12.5GBps" lat="750ns"/>
</platform>
XML
i=0
while [ $i -lt 512 ]; do
  echo "node-$i"
  i=$((i + 1))
done >"$folder/hosts"

echo "Model: $contacts contacts a rank, $ns ns a contact and sweep; us of a sweep on rank 0"
echo "ranks  contacts     most    sweep sweeping  telling  summing efficiency messages      kB"
for ranks in "$@"; do
  smpirun -np "$ranks" -platform "$folder/cluster.xml" -hostfile "$folder/hosts" \
    --cfg=network/model:CM02 --cfg=network/crosstraffic:0 --cfg=smpi/privatization:no \
    --cfg=smpi/simulate-computation:no --cfg=smpi/host-speed:1Gf --cfg=smpi/coll-selector:ompi \
    --cfg=smpi/os:0:3e-7:0 --cfg=smpi/or:0:3e-7:0 \
    --log=root.thres:error \
    "$folder/rank_model" "$contacts" "$ns" "${SWEEPS:-20}"
done
