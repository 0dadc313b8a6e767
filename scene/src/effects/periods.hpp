// Tether: frequencies that a run can tell from others. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <tether/scene/scene.hpp>

#include "toml/report.hpp"

namespace tether::scene::effects {

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
