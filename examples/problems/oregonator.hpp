// Tether: Oregonator of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Three concentrations of an oscillating reaction, stiff, t in [0, 360]; index 0. Its solution
/// keeps nothing: there are no rows.
Problem oregonator();

}  // namespace tether::problems
