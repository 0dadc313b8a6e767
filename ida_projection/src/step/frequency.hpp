// Tether: what an attempt needs between full projections. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "movers/mover.hpp"

namespace tether::ida_projection {

/// Options::frequency = n. Accepted steps n, 2n, 3n, ... and every attempt that IDA repeats are
/// projected in full. Drift that piles up over steps left alone would enter the history as a jump
/// a, of which a predictor of degree k makes binomial(k + 1, k / 2) a, 10 a at order 5, long after;
/// IDA answers with low orders and short steps. So between them a step is left alone only while the
/// drift to be expected is too short for that, and else moved with the factors at hand.
class FrequencyPolicy {
 public:
  enum class Need { nothing, chord, projection };

  explicit FrequencyPolicy(int every) : every_(every) {}
  bool on() const { return every_ > 1; }
  void reset() { *this = FrequencyPolicy(every_); }

  /// `steps` accepted before this attempt of size h; `repeated`: the last attempt was rejected.
  /// Where IDA rejects, the history is in no state to bear more: the next steps are projected in
  /// full, too, the more of them the sooner rejections follow each other.
  Need need(long steps, bool repeated, double h);
  void left_alone() { ++alone_; }
  /// The drift of this attempt was a move of `length` tolerances away.
  void looked(double length, double h);

 private:
  int every_;
  bool known_ = false;
  double rate_ = 0.0;      // drift of one step, tolerances
  double h_ = 0.0;         // step at which it was looked at
  int alone_ = 0;          // steps left alone since
  int allowed_ = 0;        // so many at most
  long pause_ = 0;         // steps to be projected in full after a rejection,
  long paused_until_ = 0;  // that is, up to this one
};

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

constexpr double kMayFollowLeave = 0.02;  // tolerances

/// Mover::follow(), y and g being the mover's own: value() evaluates g, solve() returns the length
/// of the move for it, apply() makes that move, drift() is the largest |g_i|. Lengths in
/// tolerances. `may_be_left`: of the drift, after success.
template <class Value, class Solve, class Apply, class Drift>
Move move_with_old_factors(FactorWear& wear, Value value, Solve solve, Apply apply, Drift drift,
                           double floor, double longest, double may_be_left) {
  constexpr int kMostMoves = 3;

  Move result;
  double previous = 0.0;
  while (result.moves < kMostMoves) {
    const Status status = value();
    if (status != Status::success) break;
    const double length = solve();
    if (!(length <= longest)) break;
    if (result.moves == 0) {
      result.length = length;
      result.drift_before = drift();
    } else {
      wear.looked(length / previous);
    }
    apply();
    ++result.moves;
    const bool look = result.moves == 1 && wear.must_look(length, may_be_left);
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
