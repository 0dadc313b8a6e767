// Tether: ranges of numbers in the words of a plan. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <cmath>

#include "toml/form.hpp"

namespace tether::scene::effects {

// Largest number that a motion may have, SI: quotients of such by a coefficient are numbers, too.
constexpr double kLargestMotion = 1e150;

/// A coefficient of friction that is 0, or by which impulses can be divided and multiplied.
inline void coefficient(const files::Form& form, const char* key, double& x, const Unit& unit) {
  form.number(key, x, files::kNotNegative, unit);
  if (!form.in() || x == 0 || (x >= 1 / kLargestMotion && x <= kLargestMotion)) return;
  form.in()->wrong(key, fmt::format("must be 0 or a number from {:g} to {:g}", 1 / kLargestMotion,
                                    kLargestMotion));
}

inline void coefficient(const files::Form& form, const char* key, std::optional<double>& x) {
  if (form.in() && form.in()->has(key)) x = 0;
  if (x) coefficient(form, key, *x, {});
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

/// In so many periods the phase 2 pi f t loses what the digits of a double have: it is known to .1
/// rad only.
constexpr double kMostPeriods = 1e14;

inline bool is_resolved(double frequency, double end) { return frequency * end <= kMostPeriods; }

inline std::string unresolved(double end) {
  return fmt::format(
      "has more than {:g} periods until the end, {} s: their phases are lost in rounding; at most "
      "{:.3g} Hz",
      kMostPeriods, end, kMostPeriods / end);
}

inline void check_frequency(const Scene& scene, double frequency, const Place& place,
                            const std::string& field, files::Report& report) {
  if (!is_resolved(frequency, scene.end))
    report.add(place, field, fmt::format("{}", frequency), unresolved(scene.end));
}

/// Steps of a period of a load that engines with an error test take at least: longer ones may meet
/// the sine where it is always the same, and take it for a constant.
constexpr double kStepsOfPeriod = 8;

inline bool pushes(const Load& load) {
  return load.history && load.history->frequency > 0 &&
         !(load.force.isZero(0) && load.torque.isZero(0));
}

/// The longest step that loads and `asked` allow, s; 0: any.
inline double longest_step(const Scene& scene, double asked) {
  double longest = asked;
  for (const Load& load : scene.loads) {
    if (!pushes(load)) continue;
    const double part = 1 / (kStepsOfPeriod * load.history->frequency);
    longest = longest > 0 ? std::min(longest, part) : part;
  }
  return longest;
}

}  // namespace tether::scene::effects
