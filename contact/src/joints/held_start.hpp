// Tether: impulses that hold all contacts of a mechanism. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/cones.hpp>

namespace tether::contact::detail {

/// Whether contacts share their forces in more than one way, as four wheels of a cart do: an
/// iteration may end at any lawful split, and once it has left that of the steps before it stays
/// with the other. (Slips that depend on each other, in a chain that lies on the floor, do not
/// count: held by stress along it, it left its rest.)
bool share_loads(const ConeProblem& problem);

/// The least x, each row in its own scale, that leaves w = A x - b = 0: it hangs on nothing but A
/// and b. Sets x to that and returns true where Coulomb's law allows it.
bool hold_all(const ConeProblem& problem, double tolerance, linalg::VectorX& x);

}  // namespace tether::contact::detail
