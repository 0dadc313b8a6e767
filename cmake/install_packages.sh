#!/bin/sh
# Installs the Debian packages of cmake/packages.txt that are missing (as root), or says which are.
# SPDX-License-Identifier: BSD-3-Clause
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)

if ! command -v dpkg-query >/dev/null 2>&1; then
  echo "tether: no dpkg here; the packages of cmake/packages.txt are taken to be installed" >&2
  exit 0
fi

# The packages of lines that match the pattern and are not installed.
missing() {
  sed 's/#.*//' "$here/packages.txt" | grep "$@" | while read -r package _; do
    case $(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true) in
      *' installed') ;;
      *) printf '%s ' "$package" ;;
    esac
  done
}
required=$(missing -vE ' optional|^ *$' || true)
optional=$(missing ' optional' || true)
missing="$required$optional"
missing=${missing% }
[ -n "$missing" ] || exit 0

if [ "$(id -u)" -ne 0 ]; then
  echo "tether: missing packages: $missing; install them with: sudo apt-get install --no-install-recommends $missing" >&2
  [ -z "$required" ] || exit 1
  echo "tether: they are optional; going on without" >&2
  exit 0
fi

echo "tether: installing $missing"
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086  # $missing is a list of names
if ! { apt-get update -q && apt-get install -q -y --no-install-recommends $missing; }; then
  echo "tether: apt-get could not install: $missing" >&2
  exit 1
fi
