// Tether: slider crank with a flexible rod, of the test set for IVP solvers.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// All forms of mechanism.hpp.
std::vector<std::string> slider_crank_forms();

/// Crank turned at 150 rad/s, flexible connecting rod, slider; t in [0, 0.1]. Unknowns: two angles,
/// slider position, four elastic coordinates; 3 multipliers. Linear stiffness, no damping.
///
/// The published start violates the constraints by 2e-10 and their rates by 1e-8, and the published
/// end state carries that on. `consistent`: the start moved to the nearest one with g = 0 and
/// dg/dt = 0 (first q, then v, least Euclidean change) and the reference computed from there;
/// otherwise the published start and end. Accelerations and multipliers are computed in both cases.
///
/// Rows: "position", "velocity", "acceleration", three each. The crank's drive does work: no
/// energy. The error is taken over the 7 positions.
Problem slider_crank(const std::string& form, bool consistent = true);

}  // namespace tether::problems
