// Tether: Bricard's six-bar linkage. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <problems/problem.hpp>

namespace tether::problems {

/// Case A04 of the IFToMM collection: five rods (1 m, 1 kg, square section 0.1 m) and six hinges,
/// gravity -y, released at rest. Natural coordinates: q = the inner hinges' points P1 .. P4 and
/// axes u1 .. u4, so that the mass matrix is constant and every constraint a product of two
/// vectors. 24 rows of rank 23 throughout, one freedom. F carries 23 of them (regular for every
/// integrator); the 24th, which follows from the others, stands in the group "redundant" and is
/// projected with them. Forms and rows of `Mechanism`, and "redundant" (position and rate),
/// "energy"; recommended are
/// all but the accelerations, in the form "index 0" without the redundant ones.
std::vector<std::string> bricard_forms();
Problem bricard(double t_end, const std::string& form);

/// Point P2 (the library's third joint) and kinetic energy: from the one turning angle, long
/// double.
struct BricardState {
  std::array<double, 3> point{};
  double kinetic = 0.0;
};
BricardState bricard_exact(double t);

}  // namespace tether::problems
