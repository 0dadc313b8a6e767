// Tether: wheelset of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// A railway wheelset that swings from side to side on a straight track, t in [0, 10]; index 2.
/// Unknowns: position and angles, their rates, the deviation of the spin, angle and offset of the
/// contact on the right and on the left, two multipliers. dF/dy' depends on the roll angle.
///
/// Rows: "contacts", the distances of wheel and rail less those of the published start (2), and
/// their rates (2) and tangency (4), equations of F. Friction does work: no energy.
Problem wheelset();

}  // namespace tether::problems
