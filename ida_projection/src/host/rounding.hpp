// Tether: sizes that count as none. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

namespace tether::ida_projection {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kRoundingOfTerms = 64.0 * kEpsilon;  ///< of a g, beside the sum of its terms
constexpr double kNothing = 1e-8;                     ///< tolerances: a shorter move counts as none

}  // namespace tether::ida_projection
