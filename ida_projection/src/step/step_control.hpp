// Tether: control of IDA's step sizes and orders. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "movers/mover.hpp"
#include "step/algebraic_test.hpp"
#include "step/ida_settings.hpp"
#include "step/order_limit.hpp"
#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

class Polish;

/// Smooth step sizes, the order limit and the test of algebraic variables, and the rejected steps
/// that decide whether they begin.
class StepControl {
 public:
  StepControl(const Ida& ida, const Options& options, Statistics& statistics)
      : ida_(ida),
        options_(options),
        statistics_(statistics),
        settings_(ida.mem(), options),
        smoother_(options),
        order_limit_(settings_, options) {}

  void reset();  ///< a new run starts

  /// Before the corrector; in another attempt at the step that was handed over last the weights are
  /// those that it has changed.
  void restore_weights(N_Vector weights, bool same_step);
  /// For an attempt that will be handed over, after a move of this length (infinity: it was not
  /// moved). The last polish followed the move. `tested`: the variables of IDA's error test,
  /// `differential`: those whose oscillations count (null: all); `unmoved`: the correction before a
  /// sudden move (null: an ordinary one).
  void choose_step(const Attempt& attempt, const Candidate& candidate, Polish& polish, double move,
                   N_Vector tested, N_Vector differential, N_Vector unmoved);
  /// Counts the rejected attempts before this one.
  void begin_attempt(const Attempt& attempt, bool engaged);
  /// The corrector failed in a way that a smaller step may cure.
  void corrector_failed();

  /// IDA's error test sees variables of this vector only, and these algebraic ones among them with
  /// a tolerance that moves widen.
  void suppress_others(N_Vector tested, const std::vector<int>& coupled);
  void test_all(N_Vector id) { settings_.test(id, false); }
  /// Stiff components have responded to moves; see OrderLimit.
  void expect_oscillations() { order_limit_.expect_oscillations(); }
  bool tests_algebraic() const { return algebraic_test_.acts(); }
  double weights_factor() const { return weights_factor_; }
  bool smoothing() const { return smoother_.on(); }
  /// Begins smoothing, unless Advanced::smooth_where_needed is off.
  void begin_smoothing(const SetpointFactors& factors);

  /// In the first step: whether algebraic variables fail the test at every step size.
  bool starts_off_equations(const Attempt& attempt) const;
  /// Before the first move: does IDA fail on algebraic variables in its error test, which would be
  /// taken out of it with that move?
  bool struggling(const Attempt& attempt) const;
  /// Before the first move: has the corrector failed, or the error test in a fourth of all steps?
  bool in_trouble(const Attempt& attempt) const;

 private:
  const Ida& ida_;
  const Options& options_;
  Statistics& statistics_;
  IdaSettings settings_;
  StepSmoother smoother_;
  OrderLimit order_limit_;
  AlgebraicTest algebraic_test_;
  double weights_factor_ = 1.0;  // by which IDA's weights were multiplied in the last solve
  long corrector_failures_ = 0;
  // Grows by three for an accepted step that needed more than one attempt, falls by one for others.
  int refused_ = 0;
  long last_error_failures_ = 0;
};

}  // namespace tether::ida_projection
