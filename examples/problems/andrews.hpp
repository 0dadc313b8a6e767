// Tether: Andrews' squeezer mechanism of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// All forms of mechanism.hpp.
std::vector<std::string> andrews_forms();

/// Seven bodies driven by a constant torque, t in [0, 0.03]: 7 angles, 6 multipliers.
///
/// Rows: "position", "velocity", "acceleration" (6 each) and "energy": kinetic energy + spring -
/// torque * beta = 1.437832957532139873 J, because the torque is constant.
/// Reference: converged in quadruple precision; the values published with the test set are wrong
/// from the ninth digit on. The error is taken over the 7 angles.
Problem andrews(const std::string& form);

}  // namespace tether::problems
