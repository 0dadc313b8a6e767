// Tether: Robertson's kinetics. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// "index 1" (y1 + y2 + y3 = 1 for the third equation), "index 0" (three rate equations).
std::vector<std::string> robertson_forms();

/// Three reactions with rates 0.04, 3e7, 1e4 from (1, 0, 0). Rows: "mass", y1 + y2 + y3 = 1.
/// Reference at t_end = 0.4, 40, 4e5, 1e11, otherwise NaN. y2 is small: its absolute tolerance is
/// scaled by 1e-6.
Problem robertson(double t_end, const std::string& form = "index 1");

}  // namespace tether::problems
