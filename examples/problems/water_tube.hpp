// Tether: water tubes of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Water in 18 pipes between 13 nodes, two of which are buffers, over 17 hours, t in s; index 2 by
/// the pressures of the other nodes. Unknowns: flows, resistances, pressures (buffers first).
/// Absolute tolerances are a thousandth of the relative one.
///
/// Rows: "resistance" (18) and "flow" (11), which are equations of F, and "acceleration" (11), the
/// derivative of "flow".
Problem water_tube();

}  // namespace tether::problems
