// Tether: transistor amplifier of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Eight voltages with a constant singular mass matrix of rank 5, index 1, t in [0, 0.2].
/// Every unknown appears with its derivative, so IDA's id is 1 throughout. Rows: "currents", the
/// three sums of equations in which no derivative is left; they depend on time.
Problem transistor_amplifier();

}  // namespace tether::problems
