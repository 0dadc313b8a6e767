// Tether: keeps IDA off the orders that excite oscillations (method, eq. 17).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <tether/ida_projection/options.hpp>

#include "host/candidate.hpp"
#include "host/owned_vector.hpp"
#include "step/attempt.hpp"
#include "step/ida_settings.hpp"

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
/// would pay.
///
/// To lower the order IDA's error weights are made nearly zero for three steps. All its estimates
/// are then zero, and it lowers the order by itself; IDAGetErrWeights is meaningless in these
/// steps.
class OrderLimit {
 public:
  OrderLimit(IdaSettings& settings, const Options& options)
      : settings_(settings), options_(options) {}

  /// Stiff components have responded to moves: oscillations are likely, and expected at smaller r.
  void expect_oscillations() { now_.large = kLogLargeIfStiff; }
  /// Before the first step.
  void reset();
  /// No limit for the rest of the run.
  void end();
  /// At the end of each successful solve. `tested`, `differential`: the variables of IDA's error
  /// test, and those whose oscillations count; null: all. Empty: IDA's settings are left alone.
  std::optional<Control> control(const Attempt& attempt, const Candidate& candidate,
                                 N_Vector tested, N_Vector differential) {
    if (now_.phase == Phase::off) return {};
    if (now_.pending && attempt.accepted && now_.phase != Phase::lowering) take_sample();
    if (attempt.steps % kEvery <= 1) compare_slopes(attempt, candidate, differential);
    now_.highest = std::max(now_.highest, attempt.order);
    if (now_.phase == Phase::lowering) return lower(attempt, candidate, tested);
    if (now_.phase == Phase::limited)
      judge(attempt);
    else if (attempt.order > kLimit)
      watch(attempt);
    return {};
  }
  long begun() const { return now_.limits; }

 private:
  enum class Phase { off, watching, lowering, limited };

  static constexpr int kLimit = 2;   // the highest order that damps
  static constexpr long kEvery = 4;  // steps, between two samples of r
  static constexpr double kLogLarge = -0.36, kLogLargeIfStiff = -0.6;  // of r: 0.7, 0.55

  void take_sample();
  void compare_slopes(const Attempt& attempt, const Candidate& candidate, N_Vector differential);
  void watch(const Attempt& attempt);
  Control lower(const Attempt& attempt, const Candidate& candidate, N_Vector tested);
  void judge(const Attempt& attempt);

  // From a new run on.
  struct State {
    Phase phase = Phase::off;
    long limits = 0;
    double large = kLogLarge;
    std::optional<double> pending;  // log r of an attempt that IDA has not yet judged
    int samples = 0;
    double mean = 0.0;  // of log r
    int tries = 0, highest = 0;
    double step_before = 0.0;  // the limit
    long since = 0;            // steps when it was judged last
    long trial = 40;           // steps with the limit until it is judged
    double t_since = 0.0;
    long not_before = 0;  // steps; after a limit that made the steps shorter
  };

  IdaSettings& settings_;
  const Options& options_;
  State now_;
  OwnedVector kept_slope_, slope_;  // y' of a step and of the next one
};

}  // namespace tether::ida_projection
