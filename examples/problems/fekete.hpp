// Tether: Fekete points of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// All forms of mechanism.hpp; "GGL" is the published one.
std::vector<std::string> fekete_forms();

/// Twenty points on the unit sphere repel each other, with damping, t in [0, 1000]: they come to
/// rest where the product of their distances is largest.
///
/// Rows: "position", "velocity", "acceleration" (20 each) and "angular momentum" (3): central
/// forces and proportional damping keep it at zero, and with it the orientation of the whole.
/// The error is taken over the 60 positions.
Problem fekete(const std::string& form);

}  // namespace tether::problems
