// Tether: keeps IDA off the orders that excite oscillations (method, eq. 17).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/options.hpp>

namespace tether::ida_projection {

/// BDF of order 3 to 5 amplifies undamped oscillations of frequency w where about 0.7 < w h < 5
/// (Hairer and Wanner II, V.1): a mode whose amplitude is far below the tolerance grows until it
/// limits the step size. Order 2 damps it. It shows in the ratio of the backward differences that
/// IDA's error test uses,
///
///     r = (|nabla^(k+1) y| / |nabla^2 y|)^(1 / (k - 1)),   nabla^(k+1) y = ycor,
///     nabla^2 y = h (y'_n - y'_{n-1}),
///
/// which is 2 sin(w h / 2) for the oscillation that dominates the error. A motion worth resolving,
/// of an amplitude of 1000 tolerances, has r < 0.4 at order 5. Where r stays large, the order is
/// limited to 2. The limit ends if steps become shorter with it, or if r shows that a higher order
/// would pay. Where stiff components respond to moves, the first steps return to order 2 each time
/// that IDA raises it, unless r is small.
///
/// To lower the order IDA's error weights are made nearly zero for three steps. All its estimates
/// are then zero, and it lowers the order by itself; IDAGetErrWeights is meaningless in these
/// steps.
class OrderLimit {
 public:
  OrderLimit(void* ida_mem, const Options& options) : ida_mem_(ida_mem), options_(options) {}

  /// Stiff components have responded to moves: oscillations are likely, and expected at smaller r.
  void expect_oscillations() { now_.stiff = true; }
  /// Before the first step.
  void reset();
  /// No limit for the rest of the run.
  void end();
  /// Whether y' of this attempt is kept, as that of the first of two steps in a row, or compared,
  /// as that of the second. `steps`: accepted before it.
  bool keeps_slope(long steps) const { return now_.on && steps % kEvery == 0; }
  bool compares_slopes(long steps) const { return now_.on && steps % kEvery == 1; }
  /// For such a second attempt: |ycor| and |h (y'_n - y'_{n-1})| in the norm of IDA's error test.
  void note_differences(long steps, double ycor, double curvature);
  /// At the end of each successful solve at time t. Returns by how much IDA's error weights are to
  /// be multiplied for the rest of this attempt; 1: left alone.
  double control(long steps, double t, double norm);

  bool lowering() const { return now_.phase == Phase::lowering; }
  long begun() const { return now_.begun; }

 private:
  static constexpr int kLimit = 2;
  static constexpr long kEvery = 4;
  enum class Phase { watching, lowering, limited };

  void take_sample(long steps);
  bool at_start(long steps) const;
  void watch(long steps, int order);
  double lower(int order, long steps, double t, double norm);
  void judge(long steps, double t);
  void hold_step(bool hold);

  // From a new run on.
  struct State {
    bool on = false, stiff = false;
    Phase phase = Phase::watching;
    long begun = 0;
    // of the differences
    double pending = 0.0;  // log r of an attempt that IDA has not yet judged
    long pending_steps = -1;
    int samples = 0;
    double mean = 0.0;  // of log r
    int tries = 0, highest = 0;
    bool early = false, acted_early = false;  // lowering in the first steps: now, ever
    double step_before = 0.0;                 // the limit
    long since = 0;                           // steps when it was judged last
    long trial = 40;                          // steps with the limit until it is judged
    double t_since = 0.0;
    long not_before = 0;  // steps; after a limit that made the steps shorter
  };

  void* ida_mem_;
  const Options& options_;
  State now_;
};

}  // namespace tether::ida_projection
