// Tether: planar pendulum in Cartesian coordinates. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// g for which the pendulum of length 1 that starts horizontally at rest has period 2.
constexpr double kPendulumPeriodTwo = 13.750371636040745654980191559621114395801712;

/// "index 1", "index 1 x2", "index 1 w", "index 0", "GGL", "index 2".
std::vector<std::string> pendulum_forms();

/// Point of mass 1 on a rod: x'' = -x lam, y'' = -y lam - g with x^2 + y^2 = L^2; it starts
/// horizontally at rest, at (L, 0). Unknowns (x, y, vx, vy, lam).
///
/// - "index 1": v^2 - g y - L^2 lam = 0; "index 1 x2" has x^2 + y^2 instead of L^2.
/// - "index 1 w": accelerations are unknowns, (x, y, vx, vy, wx, wy, lam).
/// - "index 0": L^2 lam' + 3 g vy = 0, an ordinary differential equation.
/// - "GGL": stabilised index 2, (x, y, vx, vy, lam, mu) with x' = vx - mu x, y' = vy - mu y and
/// both
///   position and velocity rows.
/// - "index 2": x vx + y vy = 0.
///
/// Rows: "position" (x^2 + y^2 - L^2)/2, its derivatives "velocity" and "acceleration", and
/// "energy" v^2/2 + g y. Reference: pendulum_exact.
Problem pendulum(double L, double g, double t_end, const std::string& form);

/// The exact motion (x, y, vx, vy, lam) at any t, by Jacobi's elliptic functions in long double.
void pendulum_exact(double L, double g, double t, double y[5]);

/// Its period, 4 K(1/2) sqrt(L/g).
double pendulum_period(double L, double g);

}  // namespace tether::problems
