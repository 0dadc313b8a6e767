// Tether: which metric moves are made in. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::ida_projection {

/// A move and the response of F to it over the differential variables, in tolerances.
struct MoveAndResponse {
  double move = 0.0, response = 0.0;
};

/// When to measure the response of F, and when to try the other metric (method, section 4).
class MetricChoice {
 public:
  void reset() { *this = MetricChoice(); }
  /// Is it time to look at the present move?
  bool due();
  /// Is no look due for the next move, since the last one found nothing?
  bool calm() const { return calm_ && pause_ > 1; }
  /// Do stiff components answer to it so much that it harms?
  bool stiff(const MoveAndResponse& at) const;
  /// After a measurement: do they, and is it time to try the other metric?
  bool doubts(const MoveAndResponse& at);
  /// After that trial: is the other one taken from now on?
  bool prefers(const MoveAndResponse& other, const MoveAndResponse& present);
  /// Is it time to try the other metric?
  bool may_try() { return wait_ == 0 || --wait_ == 0; }
  /// Nothing will be done about the answers: look again later.
  void pause();
  /// There is no other one, or its move failed.
  void found_none();
  bool by_levels() const { return by_levels_; }  ///< the present one

 private:
  static constexpr int kFirstWait = 2;
  bool by_levels_ = false, calm_ = false;
  int measurements_ = 0;        // that found nothing
  int pause_ = 0;               // moves until the next look
  int wait_ = 0;                // stiff answers until the next trial
  int next_wait_ = kFirstWait;  // after one that changed nothing
};

}  // namespace tether::ida_projection
