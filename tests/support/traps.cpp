// Tether: preloaded into a program, from its begin to its end.
// SPDX-License-Identifier: BSD-3-Clause
#include "traps.hpp"

namespace {
tether::test::Traps traps;
}
