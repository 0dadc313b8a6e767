// Tether: what stale factors of C leave of a move (method, section 3). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>

namespace tether::ida_projection {

/// Factors of a point `reach` tolerances away leave the part kappa reach of a move. Second moves
/// measure kappa, and are made only where it could matter. Measurements only increase kappa; a
/// safety factor of 4 covers that it is measured rarely (method, eq. 8).
class Curvature {
 public:
  void reset() { *this = Curvature(); }
  /// Whether kappa is to be measured by a second move.
  bool due(double reach, long candidate) const {
    return kappa_ < 0.0 || !(reach <= 4.0 * measured_) || candidate % kMeasureEvery == 0;
  }
  /// A second move, after a first one of length `move`, was `left` long.
  void measured(double reach, double move, double left) {
    measured_ = std::max(measured_, reach);
    kappa_ = std::max({kappa_, 0.0, left / (reach * move)});
  }
  /// Length that a move of this length leaves, in tolerances.
  double left(double reach, double length) const { return 4.0 * kappa_ * reach * length; }

 private:
  static constexpr long kMeasureEvery = 64;

  double kappa_ = -1.0;    // for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;  // longest distance at which it was measured
};

}  // namespace tether::ida_projection
