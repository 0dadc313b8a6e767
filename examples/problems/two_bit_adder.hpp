// Tether: two-bit adding unit of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Ten gates of MOS transistors that add two numbers of two bits and a carry, t in [0, 320]:
/// 175 charges and, after them, 175 potentials, Q' = f(t, V), Q = q(V), index 1. The start is the
/// published state of rest. Rows: "charges" (175), equations of F. The error is taken over the two
/// digits of the sum and its carry.
Problem two_bit_adder();

}  // namespace tether::problems
