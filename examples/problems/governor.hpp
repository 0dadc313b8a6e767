// Tether: flyball governor. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Case A05 of the IFToMM collection: a shaft turning freely about z, two hinged arms with balls, a
/// slider on the shaft, and two stiff springs with overcritical dampers from the slider to the
/// arms' centres. Initial spin 2 pi, gravity 9.81. Thirteen coordinates: height of the slider,
/// angles of both arms below the horizontal, angle of the shaft; then x, y, z of the centre of mass
/// and angle about z of each arm, angle of the slider. Nine rows of full rank, four freedoms. The
/// dampers take energy; the angular momentum about z is kept. Stiff: eigenvalues -8117 and -20
/// beside +-7.3i. Forms and rows of `Mechanism`, and "angular momentum"; all but the accelerations
/// are recommended.
std::vector<std::string> governor_forms();
Problem governor(double t_end, const std::string& form);

/// Height and speed of the slider, angle of the arms below the horizontal, angle and speed of the
/// shaft: from the equations of the two freedoms that remain by symmetry, long double.
struct GovernorState {
  double height, speed, arm, arm_rate, turn, spin;
};
GovernorState governor_exact(double t);

}  // namespace tether::problems
