// Tether: control of IDA's step sizes and orders. SPDX-License-Identifier: BSD-3-Clause
#include "step/step_control.hpp"

#include <algorithm>
#include <cmath>

#include "step/polish.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kTrapped = 30;      // ten steps in a row with failed error tests, see refused_
constexpr int kRefused = 3;       // failed error tests in one step
constexpr int kOftenRefused = 4;  // steps for each failed error test, of the run so far

// Norm of IDA's error test; `mask` is 1 for the variables that it sees.
double error_norm(N_Vector v, N_Vector weights, N_Vector mask) {
  return mask != nullptr ? N_VWrmsNormMask(v, weights, mask) : N_VWrmsNorm(v, weights);
}

}  // namespace

void StepControl::reset() {
  weights_factor_ = 1.0;
  smoother_.reset();
  order_limit_.reset();
  algebraic_test_.begin({});
  refused_ = 0;
  last_error_failures_ = 0;
  corrector_has_failed_ = false;
}

// IDA computes its weights for a new step only, so that another attempt would find changed ones.
void StepControl::restore_weights(N_Vector weights, long last_steps) {
  const long steps = ida_.steps();
  if (weights_factor_ != 1.0 && steps == last_steps)
    N_VScale(1.0 / weights_factor_, weights, weights);
  weights_factor_ = 1.0;
  algebraic_test_.restore(weights, steps);
}

void StepControl::widen_test(const Candidate& candidate, Polish& polish, double move, long steps) {
  if (!algebraic_test_.acts() || !std::isfinite(move)) return;
  algebraic_test_.begin_attempt(candidate, move, ida_.order(), std::abs(ida_.step_size()), steps);
  const bool asks = polish.iterations() > 0 && algebraic_test_.limit_step();
  algebraic_test_.widen(candidate, asks ? polish.response(ida_.step()) : nullptr);
}

// |ycor| decides the next step size, its ratio to the second difference the order.
void StepControl::control(const Candidate& candidate, long steps, bool engaged, N_Vector tested,
                          N_Vector differential, N_Vector unmoved) {
  if (!engaged && !smoother_.on()) return;
  const auto norm = [&] { return error_norm(candidate.correction, candidate.weights, tested); };
  if (smoother_.on()) {
    order_limit_.end();
    weights_factor_ = smoother_.control(steps, norm());
  } else {
    compare_slopes(candidate, steps, differential);
    weights_factor_ =
        order_limit_.control(steps, candidate.t, order_limit_.lowering() ? norm() : 0.0);
    statistics_.order_limited = order_limit_.begun();
  }
  // In the local metric a long move may undo what a jump of F has changed. The error test therefore
  // sees the longer one of the corrections before and after the move.
  if (unmoved != nullptr) {
    const double before = error_norm(unmoved, candidate.weights, tested), after = norm();
    const bool hides = before > ida_.order() + 1 && after > 0.0 && before > after;
    if (hides) weights_factor_ *= before / after;
  }
  if (weights_factor_ != 1.0) N_VScale(weights_factor_, candidate.weights, candidate.weights);
}

void StepControl::corrector_failed(bool engaged) {
  corrector_has_failed_ = true;
  if (!engaged) return;
  smoother_.refuse(std::abs(ida_.step_size()));
}

// Compares y' of two successive steps, now and then, for the order limit.
void StepControl::compare_slopes(const Candidate& candidate, long steps, N_Vector differential) {
  const bool keeps = order_limit_.keeps_slope(steps);
  if (!keeps && !(kept_slope_ && order_limit_.compares_slopes(steps))) return;
  const StepData step = ida_.step();
  if (!kept_slope_) {
    kept_slope_ = OwnedVector(candidate.base);
    slope_ = OwnedVector(candidate.base);
  }
  N_Vector slope = keeps ? kept_slope_ : slope_;
  N_VLinearSum(1.0, step.yp_predicted, step.cj, candidate.correction, slope);
  if (keeps) return;
  N_VLinearSum(1.0, slope, -1.0, kept_slope_, slope);
  order_limit_.note_differences(
      steps, error_norm(candidate.correction, candidate.weights, differential),
      ida_.step_size() * error_norm(slope, candidate.weights, differential));
}

// IDA may double its step right after a doubling was rejected, and raises the order only after k +
// 2 steps of one size. At order 1 a failed error test in each step, or after each three of one
// size, can therefore go on for ever.
void StepControl::count_refusals(bool engaged) {
  if (smoother_.on()) return;
  const long failures = ida_.error_test_failures();
  refused_ =
      failures > last_error_failures_ ? refused_ + kOftenRefused - 1 : std::max(0, refused_ - 1);
  last_error_failures_ = failures;
  if (engaged && refused_ >= kTrapped) begin_smoothing(SetpointFactors());
}

bool StepControl::struggling() const {
  if (!options_.suppress_algebraic) return false;
  return refused_ >= kTrapped || ida_.error_test_failures() - last_error_failures_ >= kRefused;
}

// A host that never tested algebraic variables, by IDASetSuppressAlg, may start off their
// equations.
bool StepControl::starts_off_equations(long steps) const {
  return steps == 0 && algebraic_test_.acts() && ida_.error_test_failures() >= kRefused &&
         algebraic_test_.stay();
}

bool StepControl::in_trouble(long steps) const {
  if (!options_.suppress_algebraic) return false;
  const long failures = ida_.error_test_failures();
  return corrector_has_failed_ || (failures > 1 && kOftenRefused * failures > steps);
}

void StepControl::begin_smoothing(const SetpointFactors& factors) {
  if (smoother_.on() || !options_.advanced.smooth_where_needed) return;
  smoother_.begin(factors);
  ++statistics_.smoothing_begun;
}

}  // namespace tether::ida_projection
