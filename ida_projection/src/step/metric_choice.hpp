// Tether: which metric moves are made in. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "movers/rows_at.hpp"
#include "step/polish.hpp"

namespace tether::ida_projection {

/// A move and the response of F to it over the differential variables, in tolerances.
struct MoveAndResponse {
  double move = 0.0, response = 0.0;
};

/// When to measure the response of F, and when to try the other metric (method, section 4).
class MetricChoice {
 public:
  void reset() { *this = MetricChoice(); }
  /// Whether the response to the present move is to be measured.
  bool due() {
    if (pause_ > 0) --pause_;
    return pause_ == 0;
  }
  /// Whether the next move needs no measurement, since the last one found nothing.
  bool calm() const { return calm_ && pause_ > 1; }
  /// Whether stiff components respond so much that it harms.
  bool stiff(const MoveAndResponse& at) const {
    return at.response > kPart * at.move && at.response > kHarm;
  }
  /// After a measurement: whether they do and the other metric is to be tried.
  bool doubts(const MoveAndResponse& at) {
    if (stiff(at)) return wait_ == 0 || --wait_ == 0;
    pause();
    calm_ = true;
    return false;
  }
  /// After that trial: whether the other metric is used from now on.
  bool prefers(const MoveAndResponse& other, const MoveAndResponse& present) {
    const bool better = other.move + other.response <= kBetter * (present.move + present.response);
    if (better)
      by_levels_ = !by_levels_;
    else
      found_none();
    return better;
  }
  /// Nothing can be done about the response: measure again later.
  void pause() {
    calm_ = false;
    pause_ = kPause;
  }
  /// There is no other metric, or its move failed.
  void found_none() {
    wait_ = next_wait_;
    next_wait_ *= 2;
  }
  bool by_levels() const { return by_levels_; }  ///< the present metric
  /// After a successful move: that one, or the one that takes its place. `high_index`: F is of
  /// index 2 or more.
  Move improved(const Candidate& candidate, Move move, RowsAt& rows, Polish& polish,
                bool high_index);

 private:
  static constexpr int kPause = 8;       // moves
  static constexpr double kPart = 0.1;   // of a move: a smaller response needs no stiff components
  static constexpr double kHarm = 1e-4;  // tolerances: a shorter response does no harm
  static constexpr double kBetter =
      0.5;  // of move and response: the other metric is taken below it

  bool by_levels_ = false, calm_ = false;
  int pause_ = 0;      // moves until the next measurement
  int wait_ = 0;       // stiff responses until the next trial
  int next_wait_ = 2;  // after one that changed nothing
};

}  // namespace tether::ida_projection
