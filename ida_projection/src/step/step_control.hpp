// Tether: control of IDA's step sizes and orders. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "host/ida.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "step/algebraic_test.hpp"
#include "step/order_limit.hpp"
#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

class Polish;

/// Smooth step sizes and the order limit, and the rejected steps that decide whether they begin.
class StepControl {
 public:
  StepControl(const Ida& ida, const Options& options, Statistics& statistics)
      : ida_(ida),
        options_(options),
        statistics_(statistics),
        smoother_(ida.mem(), options),
        order_limit_(ida.mem(), options) {}

  void reset();  ///< a new run starts

  /// At the begin of a solve: restores the weights that the last one changed in the same step.
  void restore_weights(N_Vector weights, long last_steps);
  /// At the end of a successful one, `steps` accepted before it. `engaged`: the projection acts,
  /// and the candidate's time is known; `tested`: the variables of IDA's error test,
  /// `differential`: those whose oscillations count (null: all); `unmoved`: the correction before a
  /// long move (null: a short one).
  void control(const Candidate& candidate, long steps, bool engaged, N_Vector tested,
               N_Vector differential, N_Vector unmoved);
  /// IDA's error test sees these algebraic variables, widened by the noise of moves.
  void test_algebraic(const std::vector<int>& variables) { algebraic_test_.begin(variables); }
  bool tests_algebraic() const { return algebraic_test_.acts(); }
  /// Before control(); see AlgebraicTest. The last polish followed the move.
  void widen_test(const Candidate& candidate, Polish& polish, double move, long steps);
  /// In the first step: whether algebraic variables fail the test at every step size.
  bool starts_off_equations(long steps) const;
  double weights_factor() const { return weights_factor_; }
  /// The corrector failed in a way that a smaller step may cure.
  void corrector_failed(bool engaged);

  bool smoothing() const { return smoother_.on(); }
  /// Begins smoothing with a stricter setpoint.
  void begin_smoothing(const SetpointFactors& factors);
  /// For each new step.
  void count_refusals(bool engaged);
  void expect_oscillations() { order_limit_.expect_oscillations(); }
  /// Before the first move: does IDA fail on algebraic variables in its error test, which would be
  /// taken out of it with that move?
  bool struggling() const;
  /// Before the first move: has the corrector failed, or the error test in a fourth of all steps?
  bool in_trouble(long steps) const;

 private:
  void compare_slopes(const Candidate& candidate, long steps, N_Vector differential);

  const Ida& ida_;
  const Options& options_;
  Statistics& statistics_;
  StepSmoother smoother_;
  OrderLimit order_limit_;
  AlgebraicTest algebraic_test_;
  OwnedVector kept_slope_, slope_;  // y' of a step and of the next one, for the order
  double weights_factor_ = 1.0;     // by which IDA's weights were multiplied in the last solve
  bool corrector_has_failed_ = false;
  // Grows by three for an accepted step that needed more than one attempt, falls by one for others.
  int refused_ = 0;
  long last_error_failures_ = 0;
};

}  // namespace tether::ida_projection
