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
  /// What a move of this length leaves.
  double left(double reach, double length) const { return 4.0 * staleness_ * reach * length; }

 private:
  static constexpr long kMeasureEvery = 64;

  double staleness_ = -1.0;  // for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;    // longest distance at which it was looked for
  long settles_ = 0;
};

/// By how much does a move with old factors miss the shortest one? Second moves do not tell: g
/// answers to rows that have turned by an angle a with 1 - cos a of the move, while sin a of it
/// goes astray, along the set or into components whose scale has changed. So full moves are
/// compared with what the factors before them would have made of the same g.
///
/// Lengths are those in the metric D, the rms of dy_i / D_i: where D_i is the size of the
/// corrector's own changes, they tell by which part of these a move disturbs the history, also
/// where a stiff component is far below its tolerance.
class Misdirection {
 public:
  /// The candidate is at time t.
  void look(double t) { elapsed_ = std::abs(t - made_); }
  /// The factors are made anew; measured() still is about those before.
  void renewed(double t) { made_ = t; }
  /// They would have missed the full move, of this length, by `miss`.
  void measured(double miss, double length) {
    if (!(length > kUnfelt) || elapsed_ == 0.0) return;
    turn_ = std::max(miss / (length * elapsed_), kForget * turn_);
    known_ = true;
  }
  /// May the factors at hand make a move of this length?
  bool allows(double length) const {
    return length <= kUnfelt || (known_ && turn_ * elapsed_ * length <= kMayMiss);
  }
  /// What such a move leaves grows with the square of this angle, not with the age of the factors.
  bool far() const { return turn_ * elapsed_ > kFar; }

 private:
  static constexpr double kMayMiss = 0.05;
  static constexpr double kFar = 0.3;
  static constexpr double kUnfelt = 1e-4;
  static constexpr double kForget = 0.9;  // for each measurement

  bool known_ = false;
  double turn_ = 0.0;  // part of a move that goes astray, for each unit of time
  double made_ = 0.0, elapsed_ = 0.0;
};

constexpr double kMayFollowLeave = 0.02;  // tolerances

/// Mover::follow(), y and g being the mover's own: value() evaluates g, solve() returns the length
/// of the move for it, apply() makes that move, drift() is the largest |g_i|; allows() says
/// after solve() whether it may be made as the first one, `far` that what it leaves must be looked
/// at. Lengths in tolerances. `may_be_left`: of
/// the drift, after success.
template <class Value, class Solve, class Apply, class Drift, class Allows>
Move move_with_old_factors(FactorWear& wear, Value value, Solve solve, Apply apply, Drift drift,
                           Allows allows, bool far, double floor, double longest,
                           double may_be_left) {
  constexpr int kMostMoves = 3;

  Move result;
  double previous = 0.0;
  while (result.moves < kMostMoves) {
    const Status status = value();
    if (status != Status::success) break;
    const double length = solve();
    if (!(length <= longest) || (result.moves == 0 && !allows())) break;
    if (result.moves == 0) {
      result.length = length;
      result.drift_before = drift();
    } else {
      wear.looked(length / previous);
    }
    apply();
    ++result.moves;
    const bool look = result.moves == 1 && (far || wear.must_look(length, may_be_left));
    if (length <= floor || (!look && wear.rate() * length <= may_be_left)) {
      result.status = Status::success;
      break;
    }
    if (wear.rate() > FactorWear::kWornOut) break;
    previous = length;
  }
  return result;
}

}  // namespace tether::ida_projection
