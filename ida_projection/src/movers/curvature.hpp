// Tether: what stale factors of C leave of a move (method, section 10). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>

namespace tether::ida_projection {

/// Factors that belong to a point `reach` tolerances away leave the part kappa reach of a move,
/// with kappa from second moves. These are asked for only where they could matter; what they tell
/// only ever makes kappa larger, and a factor of 4 pays for its being measured now and then.
class Curvature {
 public:
  void reset() { *this = Curvature(); }
  /// Is it time to measure it by a second move?
  bool due(double reach, long candidate) const {
    return kappa_ < 0.0 || !(reach <= 4.0 * measured_) || candidate % kMeasureEvery == 0;
  }
  /// A second move, after a first one of length `move`, was `left` long.
  void measured(double reach, double move, double left) {
    measured_ = std::max(measured_, reach);
    kappa_ = std::max({kappa_, 0.0, left / (reach * move)});
  }
  /// The rest that a move of this length leaves.
  double left(double reach, double length) const { return 4.0 * kappa_ * reach * length; }

 private:
  static constexpr long kMeasureEvery = 64;

  double kappa_ = -1.0;    // for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;  // longest distance at which it was looked for
};

}  // namespace tether::ida_projection
