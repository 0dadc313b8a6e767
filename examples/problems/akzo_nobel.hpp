// Tether: chemical Akzo Nobel problem of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Five concentrations and one algebraic equilibrium, index 1, t in [0, 180].
/// Rows: "equilibrium", Ks y1 y4 - y6, which is also the last equation of F.
Problem akzo_nobel();

}  // namespace tether::problems
