// Tether: moves with factors of an earlier step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "movers/mover.hpp"

namespace tether::ida_projection {

/// How much of a move do factors of C leave that were made `age` candidates ago? The part
/// slope * age, with the slope from second moves, which are asked for where it matters.
class FactorWear {
 public:
  static constexpr double kWornOut = 0.2;  // of a move: then factors are renewed

  void renewed() { age_ = 0; }
  /// Another candidate. False: the factors are worn; factors made anew may live longer.
  bool usable() {
    ++age_;
    ++unlooked_;
    if (rate() <= kWornOut) return true;
    slope_ *= kHope;
    doubted_ = true;
    return false;
  }
  double rate() const { return slope_ * age_; }
  /// Would a second move pay after a first one of this length, `limit` being what may be left?
  bool must_look(double length, double limit) const {
    const bool matters = rate() * length > 0.25 * limit && age_ > 2 * looked_age_;
    return slope_ < 0.0 || doubted_ || matters || unlooked_ > kLookEvery;
  }
  /// The second move was this part of the first one.
  void looked(double part) {
    slope_ = part / age_;
    looked_age_ = age_;
    unlooked_ = 0;
    doubted_ = false;
  }

 private:
  static constexpr int kLookEvery = 16;  // candidates
  static constexpr double kHope = 0.9;

  double slope_ = -1.0;  // < 0: not known yet
  int age_ = 0, looked_age_ = 0, unlooked_ = 0;
  bool doubted_ = false;
};

/// Factors that belong to a point `reach` tolerances away leave the part staleness * reach of a
/// move. What was measured only ever makes it larger.
class Staleness {
 public:
  void reset() { *this = Staleness(); }
  /// Is it time to measure it by a second move?
  bool due(double reach) {
    return staleness_ < 0.0 || reach > 4.0 * measured_ || ++settles_ % kMeasureEvery == 0;
  }
  /// A second move, after a first one of length `move`, was `left` long.
  void measured(double reach, double move, double left) {
    measured_ = std::max(measured_, reach);
    staleness_ = std::max({staleness_, 0.0, left / (reach * move)});
  }
  /// The part that a move of this length leaves.
  double left(double reach, double length) const { return 4.0 * staleness_ * reach * length; }

 private:
  static constexpr long kMeasureEvery = 64;

  double staleness_ = -1.0;  // for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;    // longest distance at which it was looked for
  long settles_ = 0;
};

}  // namespace tether::ida_projection
