// Tether: the order of the formula, raised by one. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "host/candidate.hpp"
#include "host/owned_vector.hpp"

namespace tether::ida_projection {

/// Takes the leading term of the formula's own error out of the correction; see raised_order.cpp.
class RaisedOrder {
 public:
  void allocate(N_Vector like, bool contiguous);
  void reset();  ///< a new run starts
  /// IDA has accepted the attempt that begin() told of last.
  void accepted();
  /// Something else happened between.
  void forget_times() { known_ = 0; }
  /// A new attempt, whose step ends at t; IDA's prediction of y' there.
  void begin(double t, N_Vector predicted_rate) {
    t_ = t;
    predicted_rate_ = predicted_rate;
    raised_ = false;
  }

  /// ycor <- (1 - gamma) ycor, where that is known to be right. `polished`: an iteration follows;
  /// `differential`: the variables that have a formula (null: all).
  void raise(const Candidate& candidate, int order, double cj, bool polished,
             N_Vector differential);
  bool raised() const { return raised_; }
  void leave() { raised_ = false; }

  /// What was taken; F at y without it has y' from ycor with it.
  N_Vector taken() const { return taken_; }
  /// IDA's predicted y' is shifted by cj taken() while F is evaluated.
  void shift_rate(double cj);
  void restore_rate();
  /// In tolerances.
  double length(const Candidate& candidate) const;

  /// Is it time to find out how F answers to what is taken?
  bool listens() const { return raised_ && listens_; }
  /// It did by so much, to a change of this length.
  void heard(double answer, double length);

 private:
  static constexpr int kPoints = 6;  // order + 1 at most

  bool contiguous_ = false, raised_ = false, listens_ = false;
  std::array<double, kPoints> times_{};  // of accepted steps, the last one first
  int known_ = 0;
  double t_ = 0.0;
  N_Vector predicted_rate_ = nullptr;
  OwnedVector taken_, rate_;
  bool stiff_ = true;  // or not known
  int unheard_ = 0;
  int interval_ = 1;
};

}  // namespace tether::ida_projection
