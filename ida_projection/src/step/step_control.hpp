// Tether: control of IDA's step sizes and orders. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/mechanisms.hpp"
#include "movers/rows_at.hpp"
#include "step/algebraic_test.hpp"
#include "step/ida_settings.hpp"
#include "step/order_limit.hpp"
#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

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
  void restore_weights(N_Vector weights, bool same_step) {
    const double factor = std::exchange(weights_factor_, 1.0);
    if (same_step) restore(weights, factor);
  }
  /// For an attempt that will be handed over, after a move of this length (infinity: it was not
  /// moved). The last polish followed the move. `tested`: the variables of IDA's error test,
  /// `differential`: those whose oscillations count (null: all); `unmoved`: the correction before a
  /// sudden move (null: an ordinary one); `rows`: those that were moved; null: there are none.
  void choose_step(const Attempt& attempt, const Candidate& candidate, Polish& polish, double move,
                   N_Vector tested, N_Vector differential, N_Vector unmoved, const RowsAt* rows) {
    // |ycor| decides the next step size, its ratio to the second difference the order.
    const auto norm = [&](N_Vector v) { return error_norm(v, candidate.weights, tested); };
    const bool engaged = std::isfinite(move);
    if (engaged && algebraic_test_.acts() && in_use(Mechanism::widened_tolerance)) {
      const double aside = rows->solved_length();
      algebraic_test_.widen(attempt, candidate, aside > 0.0 ? std::hypot(move, aside) : move,
                            rows->solved_for(), polish, ida_);
    }
    if (smoother_.on()) {
      apply(smoother_.control(attempt, norm(candidate.correction)));
    } else if (engaged) {
      const auto control = order_limit_.control(attempt, candidate, tested, differential);
      if (control) apply(*control);
    }
    if (unmoved != nullptr) test_unmoved(attempt, norm(unmoved), norm(candidate.correction));
    if (weights_factor_ != 1.0) N_VScale(weights_factor_, candidate.weights, candidate.weights);
  }
  /// Counts the rejected attempts before this one. IDA may double its step right after a doubling
  /// was rejected, and raises the order only after k + 2 steps of one size. At order 1 a failed
  /// error test in each step, or after each three of one size, can therefore go on for ever.
  void begin_attempt(const Attempt& attempt, bool engaged) {
    if (attempt.repeated || smoother_.on()) return;
    const bool failed = last_error_failures_ < attempt.error_test_failures;
    last_error_failures_ = attempt.error_test_failures;
    refused_ = failed ? refused_ + kOftenRefused - 1 : std::max(0, refused_ - 1);
    if (engaged && refused_ >= kTrapped) begin_smoothing(1.0);
  }
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
  void begin_smoothing(double stricter);

  /// In the first step: whether algebraic variables fail the test at every step size.
  bool starts_off_equations(const Attempt& attempt) const;
  /// Before the first move: does IDA fail on algebraic variables in its error test, which would be
  /// taken out of it with that move?
  bool struggling(const Attempt& attempt) const;
  /// Before the first move: has the corrector failed, or the error test in a fourth of all steps?
  bool in_trouble(const Attempt& attempt) const;

 private:
  static constexpr int kOftenRefused = 4;  // steps for each failed error test, of the run so far
  // Ten steps in a row with failed error tests, see refused_.
  static constexpr int kTrapped = 10 * (kOftenRefused - 1);

  void restore(N_Vector weights, double factor) const;
  void apply(const Control& control);
  void test_unmoved(const Attempt& attempt, double before, double after);

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
