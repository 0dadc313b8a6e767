// Tether: control of IDA's step sizes and orders. SPDX-License-Identifier: BSD-3-Clause
#include "step/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "step/polish.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kRefused = 3;       // failed error tests in one step
constexpr int kOftenRefused = 4;  // steps for each failed error test, of the run so far
constexpr int kTrapped =
    10 * (kOftenRefused - 1);  // ten steps in a row with failed ones, see refused_

}  // namespace

void StepControl::reset() {
  weights_factor_ = 1.0;
  order_limit_.reset();
  if (options_.step_smoothing || smoother_.on()) {
    settings_.forget();
    settings_.set({});
  }
  smoother_.end();
  if (options_.step_smoothing) smoother_.begin({});
  algebraic_test_.begin({});
  refused_ = 0;
  last_error_failures_ = corrector_failures_ = 0;
}

void StepControl::restore_weights(N_Vector weights, bool same_step) {
  const double factor = std::exchange(weights_factor_, 1.0);
  if (!same_step) return;
  if (factor != 1.0) N_VScale(1.0 / factor, weights, weights);
  algebraic_test_.restore(weights);
}

void StepControl::suppress_others(N_Vector tested, const std::vector<int>& coupled) {
  settings_.test(tested, true);
  algebraic_test_.begin(coupled);
}

// |ycor| decides the next step size, its ratio to the second difference the order.
void StepControl::choose_step(const Attempt& attempt, const Candidate& candidate, Polish& polish,
                              double move, N_Vector tested, N_Vector differential,
                              N_Vector unmoved) {
  const bool engaged = std::isfinite(move);
  if (algebraic_test_.acts() && engaged) {
    const bool limits = algebraic_test_.begin_attempt(attempt, candidate, move);
    algebraic_test_.widen(candidate,
                          limits && polish.iterations() > 0 ? polish.response(attempt) : nullptr);
  }
  if (!engaged && !smoother_.on()) return;
  const auto norm = [&](N_Vector v) { return error_norm(v, candidate.weights, tested); };
  Control control;
  if (smoother_.on()) {
    control = smoother_.control(attempt, norm(candidate.correction));
  } else {
    control = order_limit_.control(attempt, candidate, tested, differential);
    statistics_.order_limited = order_limit_.begun();
  }
  settings_.set(control.bounds);
  weights_factor_ = control.weights_factor;
  // In the local metric a sudden move may undo what a jump of F has changed. The error test
  // therefore sees the longer one of the corrections before and after the move.
  if (unmoved != nullptr) {
    const double before = norm(unmoved), after = norm(candidate.correction);
    const bool hides = before > attempt.order + 1 && after > 0.0 && before > after;
    if (hides) weights_factor_ *= before / after;
  }
  if (weights_factor_ != 1.0) N_VScale(weights_factor_, candidate.weights, candidate.weights);
}

void StepControl::corrector_failed() {
  ++corrector_failures_;
  smoother_.refuse(std::abs(ida_.step_size()));
}

// IDA may double its step right after a doubling was rejected, and raises the order only after k +
// 2 steps of one size. At order 1 a failed error test in each step, or after each three of one
// size, can therefore go on for ever.
void StepControl::begin_attempt(const Attempt& attempt, bool engaged) {
  if (attempt.repeated || smoother_.on()) return;
  const long failures = attempt.error_test_failures;
  refused_ = std::exchange(last_error_failures_, failures) < failures ? refused_ + kOftenRefused - 1
                                                                      : std::max(0, refused_ - 1);
  if (engaged && refused_ >= kTrapped) begin_smoothing({});
}

bool StepControl::struggling(const Attempt& attempt) const {
  return options_.suppress_algebraic &&
         (refused_ >= kTrapped || attempt.error_test_failures - last_error_failures_ >= kRefused);
}

// A host that never tested algebraic variables, by IDASetSuppressAlg, may start off their
// equations.
bool StepControl::starts_off_equations(const Attempt& attempt) const {
  return attempt.steps == 0 && algebraic_test_.acts() && attempt.error_test_failures >= kRefused &&
         algebraic_test_.stay();
}

bool StepControl::in_trouble(const Attempt& attempt) const {
  const long failures = attempt.error_test_failures;
  return options_.suppress_algebraic &&
         (corrector_failures_ > 0 || (failures > 1 && kOftenRefused * failures > attempt.steps));
}

void StepControl::begin_smoothing(const SetpointFactors& factors) {
  if (smoother_.on() || !options_.advanced.smooth_where_needed) return;
  order_limit_.end();
  settings_.forget();
  smoother_.begin(factors);
  ++statistics_.smoothing_begun;
}

}  // namespace tether::ida_projection
