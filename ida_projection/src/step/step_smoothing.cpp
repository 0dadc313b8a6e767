// Tether: smooth step sizes through IDA's public settings. SPDX-License-Identifier: BSD-3-Clause
//
// IDA has no hook for a step-size controller. At the end of a step it computes its own ratio
//
//     tmp = (2 err + 1e-4)^(-1 / (k + 1))
//
// and grows by min(tmp, eta_max) where tmp >= eta_max_fx, shrinks by tmp between eta_min and
// eta_low where tmp <= eta_min_fx, and keeps h otherwise. All of these can be set while the step's
// correction is being computed, so that the ratio wanted comes out, up to two limits: never more
// than tmp, and never growth where tmp < 1. A ratio below 1 where tmp >= 1 takes IDASetMaxStep, or
// error weights that are larger for the rest of the attempt.
#include "step/step_smoothing.hpp"

#include <ida/ida.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tether::ida_projection {

namespace {

constexpr double kFilter = 4.0;     // b
constexpr double kSetpoint = 4.0;   // sigma: errors are steered to 1 / sigma of what IDA allows
constexpr double kFar = 0.5;        // of the setpoint
constexpr double kOfOrder = 1.348;  // setpoints of neighbouring orders: 6^(1/6)

}  // namespace

void StepSmoother::reset() {
  const bool was_on = std::exchange(on_, options_.step_smoothing);
  settings_.reset();
  now_ = State();
  if (on_ || was_on) set({1.0, 2.0, kLargest, 0.0, options_.advanced.maximum_step});
}

// sigma_k = prod_i i h / (h + now_.h{-1} + .. + now_.h{-i}), i = 1 .. k (Brenan, Campbell and
// Petzold, 5.2).
double StepSmoother::error_constant(double h, int order) const {
  double sigma = 1.0, sum = h;
  for (int i = 1; i <= order; ++i) {
    sum += i <= now_.known ? now_.past[static_cast<std::size_t>(i - 1)] : h;
    sigma *= i * h / sum;
  }
  return sigma;
}

// c_k = max(|alpha_k + alpha_s - alpha_0|, alpha_k), by which the error test multiplies |ycor|.
double StepSmoother::test_constant(double h, int order) const {
  double sum = h, newest = 1.0, alpha_0 = -1.0, alpha_s = -1.0;  // i = 0
  for (int i = 1; i <= order; ++i) {
    sum += i <= now_.known ? now_.past[static_cast<std::size_t>(i - 1)] : h;
    newest = h / sum;
    if (i == order) break;
    alpha_0 -= newest;
    alpha_s -= 1.0 / (i + 1);
  }
  return std::max(std::abs(newest + alpha_s - alpha_0), newest);
}

void StepSmoother::attempt_was_accepted() {
  for (std::size_t i = now_.past.size() - 1; i > 0; --i) now_.past[i] = now_.past[i - 1];
  now_.past[0] = now_.h;
  now_.known = std::min(now_.known + 1, kMaximumOrder);
  if (now_.h >= kNearRefused * now_.refused) now_.refused = 0.0;
  now_.block_sum += now_.log_c;
  ++now_.block;
  if (now_.order >= options_.advanced.maximum_order) now_.previous = now_.log_c;
}

// A setpoint s makes steps shorter by s^(1/(k+1)). It depends on the order so that steps of all
// orders become shorter by the same factor.
double StepSmoother::setpoint(int order) const {
  const double graded =
      now_.factors.most * std::pow(kOfOrder, order - options_.advanced.maximum_order);
  return kSetpoint * std::max(graded, std::min(now_.factors.least, now_.factors.most));
}

double StepSmoother::filter(double log_c, int order) const {
  const double before = now_.previous.value_or(log_c);
  const double log_ratio =
      (log_c + before) / (kFilter * (order + 1)) - std::log(now_.ratio) / kFilter;
  return 1.0 + std::atan(std::exp(log_ratio) - 1.0);
}

// The last attempt, and what a new size or order h, `order` makes of it.
void StepSmoother::note_previous(long steps, double h, int order) {
  if (steps > now_.steps) {
    attempt_was_accepted();
  } else {
    now_.previous.reset();  // rejected: IDA has cut the step by its own rule
    now_.refused = now_.h;
    now_.ratio = 1.0;
    now_.end_block();
  }
  const bool same_order = order == now_.order;
  const bool same_size = now_.known > 0 && h == now_.past[0];
  if (!same_order) now_.previous.reset();
  if (same_order && now_.known > 0 && !same_size)
    now_.ratio = h / now_.past[0];
  else if (!same_order || order >= options_.advanced.maximum_order)
    now_.ratio = 1.0;
  if (same_order && same_size) return;
  if (same_order && order < options_.advanced.maximum_order && now_.block > 0)
    now_.previous = now_.block_sum / now_.block;
  now_.end_block();
}

double StepSmoother::control(long steps, double norm) {
  sunrealtype h = 0.0;
  int order = 1;
  IDAGetCurrentStep(ida_mem_, &h);
  IDAGetCurrentOrder(ida_mem_, &order);
  h = std::abs(h);
  if (now_.steps >= 0) note_previous(steps, h, order);
  const double error = error_constant(h, order) * norm;
  const bool grows = 2.0 * error + 1e-4 <= 1.0;  // IDA's tmp >= 1
  const double log_c = -std::log(setpoint(order) * error + 1e-4);
  now_.steps = steps;
  now_.h = h;
  now_.order = order;
  now_.log_c = log_c;
  if (!std::isfinite(log_c)) {
    hold();
  } else if (!options_.step_smoothing && far_below(log_c, order) && !near_refused(kLargest * h)) {
    return request(kLargest, h, grows, norm);
  } else if (order >= options_.advanced.maximum_order) {
    return request(filter(log_c, order), h, grows, norm);
  } else if (now_.block + 1 >= order + 2) {  // with this one, k + 2 steps of one size
    return request(filter((now_.block_sum + log_c) / (now_.block + 1), order), h, grows, norm);
  } else {
    hold();
  }
  return 1.0;
}

// Whether the error of a doubled step would still be far below the setpoint.
bool StepSmoother::far_below(double log_c, int order) const {
  return log_c >= (order + 1) * std::log(kLargest) - std::log(kFar);
}

// Keep h, or reduce it by IDA's own rule.
void StepSmoother::hold() { set({1.0, kAnyRatio, kLargest, 0.0, options_.advanced.maximum_step}); }

// `grows`: IDA's own ratio is 1 or more.
double StepSmoother::request(double ratio, double h, bool grows, double norm) {
  if (!grows && ratio < 1.0) {
    set({1.0, kAnyRatio, kLargest, ratio, options_.advanced.maximum_step});
  } else if (!grows) {
    set({0.0, kAnyRatio, kLargest, 0.0, options_.advanced.maximum_step});
  } else if (ratio > 1.0) {
    set({1.0, 1.0, ratio, 0.0, options_.advanced.maximum_step});
  } else if (!options_.step_smoothing) {
    return reduce_by_weights(ratio, h, norm);
  } else {
    const double longest = h * ratio;
    set({1.0, 1.0, kLargest, 0.0,
         options_.advanced.maximum_step > 0.0 ? std::min(options_.advanced.maximum_step, longest)
                                              : longest});
  }
  return 1.0;
}

// IDA reduces h by any requested ratio if its own ratio is below 1, that is, for an error above
// 0.5. The weights are multiplied so that the error exceeds 0.5 but passes the test. The order,
// which compares errors, does not change.
double StepSmoother::reduce_by_weights(double ratio, double h, double norm) {
  constexpr double kReducing = 0.55, kPassed = 0.95;
  const double factor = kReducing / (error_constant(h, now_.order) * norm);
  if (!(factor > 1.0) || factor * test_constant(h, now_.order) * norm > kPassed) {
    hold();
    return 1.0;
  }
  set({1.0, kAnyRatio, kLargest, ratio, options_.advanced.maximum_step});
  return factor;
}

// IDA checks what each function is given: those whose value stays are left out.
void StepSmoother::set(const Settings& to) {
  const auto changes = [&](double Settings::*value) {
    return !settings_ || (*settings_).*value != to.*value;
  };
  if (changes(&Settings::lowest_fixed) || changes(&Settings::highest_fixed))
    IDASetEtaFixedStepBounds(ida_mem_, to.lowest_fixed, to.highest_fixed);
  if (changes(&Settings::largest)) IDASetEtaMax(ida_mem_, to.largest);
  if (changes(&Settings::low)) {
    IDASetEtaLow(ida_mem_, to.low > 0.0 ? to.low : 0.9);
    IDASetEtaMin(ida_mem_, to.low > 0.0 ? to.low : 0.5);
  }
  if (options_.step_smoothing && changes(&Settings::max_step)) IDASetMaxStep(ida_mem_, to.max_step);
  settings_ = to;
}

}  // namespace tether::ida_projection
