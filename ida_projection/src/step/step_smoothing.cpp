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

namespace tether::ida_projection {

namespace {

constexpr double kFilter = 4.0;     // b
constexpr double kSetpoint = 4.0;   // sigma: errors are steered to 1 / sigma of what IDA allows
constexpr double kFar = 0.5;        // of the setpoint
constexpr double kOfOrder = 1.348;  // setpoints of neighbouring orders: 6^(1/6)

// IDA's defaults.
constexpr double kLowestFixed = 1.0, kHighestFixed = 2.0, kLargest = 2.0, kLow = 0.9, kMin = 0.5;

}  // namespace

StepSmoother::StepSmoother(void* ida_mem, const Options& options)
    : ida_mem_(ida_mem),
      wanted_(options.step_smoothing),
      max_step_(options.advanced.maximum_step),
      max_order_(options.advanced.maximum_order) {}

void StepSmoother::reset() {
  const bool was_on = on_;
  on_ = owns_max_step_ = wanted_;
  known_to_ida_ = false;
  pending_ = has_previous_ = false;
  steps_ = -1;
  known_ = block_ = 0;
  block_sum_ = 0.0;
  ratio_ = 1.0;
  care_ = Care();
  refused_ = 0.0;
  if (on_ || was_on) set(kLowestFixed, kHighestFixed, kLargest, 0.0, max_step_);
}

// sigma_k = prod_i i h / (h + h_{-1} + .. + h_{-i}), i = 1 .. k (Brenan, Campbell and
// Petzold, 5.2).
double StepSmoother::error_constant(double h, int order) const {
  double sigma = 1.0, sum = h;
  for (int i = 1; i <= order; ++i) {
    sum += i <= known_ ? past_[static_cast<std::size_t>(i - 1)] : h;
    sigma *= i * h / sum;
  }
  return sigma;
}

// c_k = max(|alpha_k + alpha_s - alpha_0|, alpha_k), by which the error test multiplies |ycor|.
double StepSmoother::test_constant(double h, int order) const {
  double sum = h, newest = 1.0, alpha_0 = -1.0, alpha_s = -1.0;  // i = 0
  for (int i = 1; i <= order; ++i) {
    sum += i <= known_ ? past_[static_cast<std::size_t>(i - 1)] : h;
    newest = h / sum;
    if (i == order) break;
    alpha_0 -= newest;
    alpha_s -= 1.0 / (i + 1);
  }
  return std::max(std::abs(newest + alpha_s - alpha_0), newest);
}

void StepSmoother::attempt_was_accepted() {
  for (std::size_t i = past_.size() - 1; i > 0; --i) past_[i] = past_[i - 1];
  past_[0] = h_;
  known_ = std::min(known_ + 1, kMaximumOrder);
  if (h_ >= kNearRefused * refused_) refused_ = 0.0;
  block_sum_ += log_c_;
  ++block_;
  if (order_ >= max_order_) {
    previous_ = log_c_;
    has_previous_ = true;
  }
}

// A setpoint s makes steps shorter by s^(1/(k+1)). It depends on the order so that steps of all
// orders become shorter by the same factor.
double StepSmoother::setpoint(int order) const {
  const double graded = care_.most * std::pow(kOfOrder, order - max_order_);
  return kSetpoint * std::max(graded, std::min(care_.least, care_.most));
}

double StepSmoother::filter(double log_c, int order) const {
  const double before = has_previous_ ? previous_ : log_c;
  const double log_ratio = (log_c + before) / (kFilter * (order + 1)) - std::log(ratio_) / kFilter;
  return 1.0 + std::atan(std::exp(log_ratio) - 1.0);
}

double StepSmoother::control(long steps, double norm) {
  sunrealtype h = 0.0;
  int order = 1;
  IDAGetCurrentStep(ida_mem_, &h);
  IDAGetCurrentOrder(ida_mem_, &order);
  h = std::abs(h);
  if (pending_) {
    if (steps > steps_) {
      attempt_was_accepted();
    } else {
      has_previous_ = false;  // rejected: IDA has cut the step by its own rule
      refused_ = h_;
      ratio_ = 1.0;
      block_ = 0;
      block_sum_ = 0.0;
    }
    if (order != order_) {
      has_previous_ = false;
      ratio_ = 1.0;
    } else if (known_ > 0 && h != past_[0]) {
      ratio_ = h / past_[0];
    } else if (order >= max_order_) {
      ratio_ = 1.0;
    }
    if (order != order_ || known_ == 0 || h != past_[0]) {
      if (order == order_ && order < max_order_ && block_ > 0) {
        previous_ = block_sum_ / block_;
        has_previous_ = true;
      }
      block_ = 0;
      block_sum_ = 0.0;
    }
  }

  const double error = error_constant(h, order) * norm;
  const bool grows = 2.0 * error + 1e-4 <= 1.0;  // IDA's tmp >= 1
  const double log_c = -std::log(setpoint(order) * error + 1e-4);
  pending_ = true;
  steps_ = steps;
  h_ = h;
  order_ = order;
  log_c_ = log_c;
  if (!std::isfinite(log_c)) {
    hold();
  } else if (!wanted_ && far_below(log_c, order) && !near_refused(kLargest * h)) {
    return request(kLargest, h, grows, norm);
  } else if (order >= max_order_) {
    return request(filter(log_c, order), h, grows, norm);
  } else if (block_ + 1 >= order + 2) {  // with this one, k + 2 steps of one size
    return request(filter((block_sum_ + log_c) / (block_ + 1), order), h, grows, norm);
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
void StepSmoother::hold() { set(kLowestFixed, kAnyRatio, kLargest, 0.0, max_step_); }

// `grows`: IDA's own ratio is 1 or more.
double StepSmoother::request(double ratio, double h, bool grows, double norm) {
  if (!grows) {
    if (ratio < 1.0)
      set(kLowestFixed, kAnyRatio, kLargest, ratio, max_step_);
    else
      set(0.0, kAnyRatio, kLargest, 0.0, max_step_);
  } else if (ratio > 1.0) {
    set(kLowestFixed, 1.0, ratio, 0.0, max_step_);
  } else if (!owns_max_step_) {
    return reduce_by_weights(ratio, h, norm);
  } else {
    const double longest = h * ratio;
    set(kLowestFixed, 1.0, kLargest, 0.0, max_step_ > 0.0 ? std::min(max_step_, longest) : longest);
  }
  return 1.0;
}

// IDA reduces h by any requested ratio if its own ratio is below 1, that is, for an error above
// 0.5. The weights are multiplied so that the error exceeds 0.5 but passes the test. The order,
// which compares errors, does not change.
double StepSmoother::reduce_by_weights(double ratio, double h, double norm) {
  constexpr double kAsked = 0.55, kPassed = 0.95;
  const double factor = kAsked / (error_constant(h, order_) * norm);
  if (!(factor > 1.0) || factor * test_constant(h, order_) * norm > kPassed) {
    hold();
    return 1.0;
  }
  set(kLowestFixed, kAnyRatio, kLargest, ratio, max_step_);
  return factor;
}

// Calls IDA's setters only for values that have changed.
void StepSmoother::set(double lowest_fixed, double highest_fixed, double largest, double low,
                       double max_step) {
  const Settings now{lowest_fixed, highest_fixed, largest, low, max_step};
  const bool all = !known_to_ida_;
  if (all || now.lowest_fixed != set_.lowest_fixed || now.highest_fixed != set_.highest_fixed)
    IDASetEtaFixedStepBounds(ida_mem_, lowest_fixed, highest_fixed);
  if (all || now.largest != set_.largest) IDASetEtaMax(ida_mem_, largest);
  if (all || now.low != set_.low) {
    IDASetEtaLow(ida_mem_, low > 0.0 ? low : kLow);
    IDASetEtaMin(ida_mem_, low > 0.0 ? low : kMin);
  }
  if (owns_max_step_ && (all || now.max_step != set_.max_step)) IDASetMaxStep(ida_mem_, max_step);
  set_ = now;
  known_to_ida_ = true;
}

}  // namespace tether::ida_projection
