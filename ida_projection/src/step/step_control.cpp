// Tether: control of IDA's step sizes and orders. SPDX-License-Identifier: BSD-3-Clause
#include "step/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tether::ida_projection {

namespace {

constexpr int kRefused = 3;  // failed error tests in one step

}  // namespace

void StepControl::reset() {
  weights_factor_ = 1.0;
  order_limit_.reset();
  if (options_.step_smoothing || smoother_.on()) {
    settings_.forget();
    settings_.set({});
  }
  smoother_.end();
  if (options_.step_smoothing) smoother_.begin(1.0);
  algebraic_test_.begin({});
  refused_ = 0;
  last_error_failures_ = corrector_failures_ = 0;
}

void StepControl::restore(N_Vector weights, double factor) const {
  if (factor != 1.0) N_VScale(1.0 / factor, weights, weights);
  algebraic_test_.restore(weights);
}

void StepControl::suppress_others(N_Vector tested, const std::vector<int>& coupled) {
  settings_.test(tested, true);
  algebraic_test_.begin(coupled);
}

void StepControl::apply(const Control& control) {
  settings_.set(control.bounds);
  weights_factor_ = control.weights_factor;
  statistics_.order_limited = order_limit_.begun();
}

// In the local metric a sudden move may undo what a jump of F has changed. The error test therefore
// sees the longer one of the corrections before and after the move.
void StepControl::test_unmoved(const Attempt& attempt, double before, double after) {
  const bool hides = before > attempt.order + 1 && after > 0.0 && before > after;
  if (hides) weights_factor_ *= before / after;
}

void StepControl::corrector_failed() {
  ++corrector_failures_;
  smoother_.refuse(std::abs(ida_.step_size()));
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

void StepControl::begin_smoothing(double stricter) {
  if (smoother_.on() || !options_.advanced.smooth_where_needed) return;
  order_limit_.end();
  settings_.forget();
  smoother_.begin(stricter);
  ++statistics_.smoothing_begun;
}

}  // namespace tether::ida_projection
