// Tether: impulses that hold all contacts of a mechanism. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/cones.hpp>

namespace tether::contact::detail {

/// Whether contacts can share their loads in more than one way, as four wheels of a cart can. An
/// iteration may end at any lawful distribution and would jump between them from step to step.
/// (Slips that depend on each other, as in a chain on the floor, do not count: with a stress along
/// it the chain did not stay at rest.)
bool share_loads(const ConeProblem& problem);

/// The least x, each row in its own scale, with A x = b: it depends on A and b alone. Sets x to it
/// and returns true if Coulomb's law allows it.
bool hold_all(const ConeProblem& problem, double tolerance, linalg::VectorX& x);

}  // namespace tether::contact::detail
