#!/bin/sh
# The core of the projection knows none of its add-ons, its rooms stand on each other in one order, and a program links none that it does not use.
# SPDX-License-Identifier: BSD-3-Clause
#
#   layout.sh SOURCES PROGRAM      PROGRAM projects by one added call, linked to a static library
set -eu
for folder in attach constraints host movers rows start step watch; do
  if grep -rn '#include "\(sensitivity\|distributed\|c\|reverse\|preload\)/' "$1/$folder"; then
    echo "$folder includes an add-on" >&2
    exit 1
  fi
done
# No room uses one that uses it.
for folder in attach constraints host movers rows start step watch; do
  grep -rhoE '^#include "[a-z_]+/' "$1/$folder" | sed 's/.*"//; s#/$##' | sort -u | grep -vx "$folder" | sed "s/^/$folder /"
done | tsort >/dev/null
# Programs of benchmarks/, which tests/run.sh does not build, look inside, too.
for header in $(grep -rhoE '#include [<"](attach|constraints|host|movers|rows|start|step|watch)/[a-z_/]+[.]hpp' \
  "$1/../../benchmarks" "$1/../../tests" | sed 's/.*[<"]//' | sort -u); do
  if [ ! -f "$1/$header" ]; then
    echo "$header is included, but is not there" >&2
    exit 1
  fi
done
# Which symbols are there shows that names are seen at all.
names=$(nm -C "$2" | grep -o 'tether::ida_projection::[A-Z][A-Za-z]*' | sort -u)
echo "$names" | grep -q 'RowsAt$'
for name in SensitivityCorrector ParameterDerivative DistributedStore GradientStore; do
  if echo "$names" | grep -q "::$name\$"; then
    echo "$2 has $name" >&2
    exit 1
  fi
done
