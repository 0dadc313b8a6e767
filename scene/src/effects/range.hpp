// Tether: ranges of numbers in the words of a plan. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tether/scene/scene.hpp>
#include <vector>

#include "toml/fields.hpp"

namespace tether::scene::effects {

// Largest number that a motion may have, SI: quotients of such by a coefficient are numbers, too.
constexpr double kLargestMotion = 1e150;

/// A coefficient of friction that is 0, or by which impulses can be divided and multiplied.
inline double read_coefficient(files::Fields& in, const char* key, double otherwise,
                               const char* unit) {
  const double value = in.number(key, otherwise, files::kNotNegative, unit);
  if (value == 0 || (value >= 1 / kLargestMotion && value <= kLargestMotion)) return value;
  in.wrong(key, fmt::format("must be 0 or a number from {:g} to {:g}", 1 / kLargestMotion,
                            kLargestMotion));
  return otherwise;
}

/// "0.3", or "0.1 to 0.5" where the pairs that touch differ; there must be one.
inline std::string range(const std::vector<Pair>& pairs, double Pair::*value) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Pair& pair : pairs) {
    if (!pair.touch) continue;
    low = std::min(low, pair.*value);
    high = std::max(high, pair.*value);
  }
  return low == high ? fmt::format("{}", low) : fmt::format("{} to {}", low, high);
}

}  // namespace tether::scene::effects
