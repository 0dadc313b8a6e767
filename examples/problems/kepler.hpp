// Tether: the two-body problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// x'' = -x/r^3, y'' = -y/r^3 from the pericentre (1 - e, 0) of an ellipse with semi-axis 1, period
/// 2 pi; unknowns (x, y, vx, vy), an ordinary differential equation; 0 <= e < 1.
///
/// Rows: "energy" -1/2, "momentum" x vy - y vx, "eccentricity" (Laplace, Runge, Lenz; two rows).
/// The four rows have rank 3 everywhere; energy and momentum alone lose rank at e = 0.
/// Reference at any t_end by Kepler's equation.
Problem kepler(double e, double t_end);

}  // namespace tether::problems
