// Tether: frequencies that a run can tell from others. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

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

}  // namespace tether::scene::effects
