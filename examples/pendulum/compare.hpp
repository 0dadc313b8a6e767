// Tether: CPU time against plain IDA's. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "measure.hpp"

namespace pendulum {

/// One line of a picture of error against CPU time.
struct Curve {
  std::string form;
  Invariants invariants = Invariants::none;
  std::vector<const Result*> points;  ///< those that did not fail, loosest tolerance first

  std::string constraints() const {
    return points.empty() ? "" : points.front()->what.constraints();
  }
};

std::vector<Curve> curves(const Results& results);

/// CPU time in ms that a curve needs for an error: interpolated on logarithmic axes between runs of
/// neighbouring tolerances. Where an error is met more than once, the shortest time counts.
/// never: it is never that small; unknown: it is always smaller.
Ratio time_for(const Curve& curve, double error);

/// Fills same_tolerance and same_error of every run.
void compare_with_plain(Results& results);

}  // namespace pendulum
