#!/bin/sh
# preload.sh <libtether_preload.so> <preload_host>: the host under the library. SPDX-License-Identifier: BSD-3-Clause
LD_PRELOAD=$1 exec "$2"
