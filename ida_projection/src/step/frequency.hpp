// Tether: the kind of projection of an attempt between full ones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

namespace tether::ida_projection {

/// Options::frequency = n. Accepted steps n, 2n, 3n, ... and every attempt that IDA repeats are
/// projected in full. Drift that piles up over steps left alone would enter the history as a jump
/// a, of which a predictor of degree k makes binomial(k + 1, k / 2) a, 10 a at order 5, long after;
/// IDA answers with low orders and short steps. So between them a step is left alone only while the
/// drift to be expected is too short for that, and else moved with the factors at hand. Where IDA
/// rejects often there may be stiff components, to which a small part of a tolerance is a jump:
/// there only few steps in a row are left alone. None are while the step grows: IDA keeps a size
/// until it can double it, so that a start that differs a little may end at half the size for good.
class FrequencyPolicy {
 public:
  enum class Need { nothing, chord, projection };

  explicit FrequencyPolicy(int every) : every_(every) {}
  bool on() const { return every_ > 1; }
  void reset() { *this = FrequencyPolicy(every_); }

  /// `steps` accepted before this attempt of size h; `repeated`: the last attempt was rejected.
  /// Where IDA rejects, the history is in no state to bear more: the next steps are projected in
  /// full, too, the more of them the sooner rejections follow each other.
  /// `moved`: has any step of this run been moved?
  Need need(long steps, bool repeated, double h, bool moved);
  void left_alone() { ++alone_; }
  /// The drift of this attempt was a move of `length` tolerances away.
  void looked(double length, double h);
  /// The same where it was looked at or projected in full.
  void projected(double length, double h) {
    looked(length, h);
    full_h_ = h;
  }

 private:
  int every_;
  bool known_ = false;
  double rate_ = 0.0;      // drift of one step, tolerances
  double h_ = 0.0;         // step at which it was looked at
  double full_h_ = 0.0;    // step of the last full projection
  long repeated_at_ = 0;   // steps accepted before the last rejection
  int alone_ = 0;          // steps left alone since
  int allowed_ = 0;        // so many at most
  long started_ = 1;       // IDA is looking for its first step size up to this one
  long pause_ = 0;         // steps to be projected in full after a rejection,
  long paused_until_ = 0;  // that is, up to this one
};

}  // namespace tether::ida_projection
