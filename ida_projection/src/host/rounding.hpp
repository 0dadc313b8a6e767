// Tether: rounding, and what differences and observations are worth. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

namespace tether::ida_projection {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kRoundingOfTerms = 64.0 * kEpsilon;  ///< of a g, beside the sum of its terms
constexpr double kNothing = 1e-8;                     ///< tolerances: a shorter move counts as none

/// Increments of difference quotients, in parts of the size of what is changed: of first and second
/// order, against cancellation at tight tolerances; of fourth order, where rounding over it and its
/// fourth power both are 1e-12.
constexpr double kIncrement = 1e-5, kWideIncrement = 1e-3;
/// Parts of rows of difference quotients that say nothing: quotients are good to 1e-6, products of
/// them lose another digit.
constexpr double kQuotientRounding = 1e-6, kProductRounding = 10.0 * kQuotientRounding;

/// Observations that cost as much as the rest of an attempt are made in one of kOneIn attempts;
/// quantities that change slowly are measured anew in one of kMeasureEvery.
constexpr int kOneIn = 16;
constexpr long kMeasureEvery = 64;

/// Whether a row of this length has no direction.
inline bool vanishes(double norm) { return !(norm > std::numeric_limits<double>::min()); }

/// Between 1 and 2, varies irregularly with j: changes of y in these proportions do not cancel.
inline double irregular(std::size_t j, double turn = 2.3) {
  return 1.5 + 0.5 * std::sin(1.0 + turn * static_cast<double>(j));
}

}  // namespace tether::ida_projection
