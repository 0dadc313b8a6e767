// Tether: car axis of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// All forms of mechanism.hpp.
std::vector<std::string> car_axis_forms();

/// Car axis on a bumpy road, t in [0, 3]: q = (xl, yl, xr, yr), two multipliers; constraints and
/// the moving wheel (xb, yb) depend on time, so nothing but the constraints is kept. Rows:
/// "position", "velocity", "acceleration", two each (road, axle).
Problem car_axis(const std::string& form);

}  // namespace tether::problems
