// Tether: predator and prey. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// x' = x (1 - y), y' = y (x - 1) from (x0, y0) > 0, an ordinary differential equation.
/// Rows: "invariant", x - ln x + y - ln y. Reference at any t_end.
Problem lotka_volterra(double x0, double y0, double t_end);

}  // namespace tether::problems
