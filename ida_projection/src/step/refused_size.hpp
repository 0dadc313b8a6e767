// Tether: the step size at which the corrector failed. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::ida_projection {

/// IDA quarters h after a failed corrector, and doubles it as soon as the error test allows that:
/// two steps later it tries the size that has just failed, at the same order. At orders 1 and 2 a
/// smaller size is kept here until IDA may raise its order, which takes k + 2 steps of one size.
class RefusedSize {
 public:
  explicit RefusedSize(void* ida_mem) : ida_mem_(ida_mem) {}

  void reset() {
    forget();
    same_ = 0;
    steps_ = -1;
  }
  /// IDA may double its step again.
  void forget();
  /// The corrector failed with a step of this size.
  void refuse(double h) { refused_ = h; }
  /// At the end of each successful solve with a step of size h > 0, `steps` accepted before it: has
  /// IDA keep h where twice that would be what was refused.
  void control(long steps, double h, int order);

 private:
  void hold(bool wanted);

  void* ida_mem_;
  double refused_ = 0.0;  // 0: none
  bool holding_ = false;
  // the last attempt, and how many accepted steps of its size and order there are with it
  long steps_ = -1;
  double h_ = 0.0;
  int order_ = 0, same_ = 0;
};

}  // namespace tether::ida_projection
