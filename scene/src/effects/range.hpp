// Tether: ranges of numbers in the words of a plan. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene::effects {

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
