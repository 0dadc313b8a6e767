#!/bin/sh
# Installs the Debian packages of cmake/packages.txt that are missing (as root), or says which are.
# SPDX-License-Identifier: BSD-3-Clause
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)

if ! command -v dpkg-query >/dev/null 2>&1; then
  echo "tether: no dpkg here; the packages of cmake/packages.txt are taken to be installed" >&2
  exit 0
fi

missing=
for package in $(sed 's/#.*//' "$here/packages.txt"); do
  case $(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true) in
    *' installed') ;;
    *) missing="$missing $package" ;;
  esac
done
missing=${missing# }
[ -n "$missing" ] || exit 0

if [ "$(id -u)" -ne 0 ]; then
  echo "tether: missing packages: $missing; install them with: sudo apt-get install --no-install-recommends $missing" >&2
  exit 1
fi

echo "tether: installing $missing"
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086  # $missing is a list of names
if ! { apt-get update -q && apt-get install -q -y --no-install-recommends $missing; }; then
  echo "tether: apt-get could not install: $missing" >&2
  exit 1
fi
