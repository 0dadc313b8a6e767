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

#include <algorithm>
#include <cmath>

#include "host/mechanisms.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kFilter = 4.0;    // b
constexpr double kSetpoint = 4.0;  // sigma: errors are steered to 1 / sigma of what IDA allows
constexpr double kFar = 0.5;       // of the setpoint
constexpr StepBounds kHold{1.0, kAnyRatio};  // keep h, or reduce it by IDA's own rule

// Factors of the setpoint in index 2: errors of multipliers, which leave the test, enter those of
// the others. End errors follow the tolerance where unknowns are more than 1 / kProportional
// tolerances and rows leave this part of the directions free.
constexpr double kAsideFromTest = 1.5, kProportional = 3e-4, kManyFree = 0.4;

}  // namespace

// End errors follow (tolerance / s)^(k/(k+1)) at order k, so that s in proportion to
// tolerance^(-1/k), with k = 5, makes them follow the tolerance. Where rows leave few directions
// free the projection removes most of the error.
double stricter_in_index_2(const Candidate& candidate, const AlgebraicVariables& variables,
                           int rows) {
  const N_Vector id = variables.id();
  if (!in_use(Mechanism::stricter_setpoint) || variables.undetermined().empty() ||
      rows > (1.0 - kManyFree) * N_VDotProd(id, id))
    return kAsideFromTest;
  const double unknowns = N_VWrmsNormMask(candidate.base, candidate.weights, id);  // in tolerances
  return std::max(1.0, std::pow(kProportional * unknowns, 0.2));
}

// sigma_k = prod_i i h / (h + h_{-1} + .. + h_{-i}), i = 1 .. k (Brenan, Campbell and Petzold,
// 5.2).
double StepSmoother::error_constant(double h, int order) const {
  double sigma = 1.0, sum = h;
  for (int i = 1; i <= order; ++i) {
    sum += now_->past_or(h, i - 1);
    sigma *= i * h / sum;
  }
  return sigma;
}

// c_k = max(|alpha_k + alpha_s - alpha_0|, alpha_k), by which the error test multiplies |ycor|.
double StepSmoother::test_constant(double h, int order) const {
  double sum = h, newest = 1.0, alpha_0 = -1.0, alpha_s = -1.0;  // i = 0
  for (int i = 1; i <= order; ++i) {
    sum += now_->past_or(h, i - 1);
    newest = h / sum;
    if (i == order) break;
    alpha_0 -= newest;
    alpha_s -= 1.0 / (i + 1);
  }
  return std::max(std::abs(newest + alpha_s - alpha_0), newest);
}

double StepSmoother::filter(double log_c, int order) const {
  const double before = now_->previous.value_or(log_c);
  const double log_ratio =
      (log_c + before) / (kFilter * (order + 1)) - std::log(now_->ratio) / kFilter;
  return 1.0 + std::atan(std::exp(log_ratio) - 1.0);
}

// The last attempt, and what a new size or order h, `order` makes of it.
void StepSmoother::note_previous(bool accepted, double h, int order) {
  State& s = *now_;
  const bool at_top = order >= options_.advanced.maximum_order;
  if (accepted) {
    std::copy_backward(s.past.begin(), s.past.end() - 1, s.past.end());
    s.past[0] = s.h;
    s.known = std::min(s.known + 1, kMaximumOrder);
    if (s.h >= kNearRefused * s.refused) s.refused = 0.0;
    s.block_sum += s.log_c;
    ++s.block;
    if (s.order >= options_.advanced.maximum_order) s.previous = s.log_c;
  } else {  // IDA has cut the step by its own rule
    s.previous.reset();
    s.refused = s.h;
    s.ratio = 1.0;
    s.end_block();
  }
  const bool same_order = order == s.order;
  const bool same_size = s.known > 0 && h == s.past[0];
  if (!same_order) s.previous.reset();
  if (same_order && s.known > 0 && !same_size)
    s.ratio = h / s.past[0];
  else if (!same_order || at_top)
    s.ratio = 1.0;
  if (same_order && same_size) return;
  if (same_order && !at_top && s.block > 0) s.previous = s.block_sum / s.block;
  s.end_block();
}

Control StepSmoother::control(const Attempt& attempt, double norm) {
  State& s = *now_;
  const double h = std::abs(attempt.h);
  const int order = attempt.order;
  if (s.h > 0.0) note_previous(attempt.accepted, h, order);
  const double error = error_constant(h, order) * norm;
  const double log_c = -std::log(kSetpoint * s.stricter * error + 1e-4);
  s.h = h;
  s.order = order;
  s.log_c = log_c;
  if (!std::isfinite(log_c)) return {kHold};
  // Whether the error of a doubled step would still be far below the setpoint.
  const bool far = log_c >= (order + 1) * std::log(kLargest) - std::log(kFar);
  const bool near_refused = s.refused > 0.0 && kLargest * h >= kNearRefused * s.refused;
  if (!options_.step_smoothing && far && !near_refused) return request(kLargest, error, norm);
  if (order >= options_.advanced.maximum_order) return request(filter(log_c, order), error, norm);
  if (s.block + 1 < order + 2) return {kHold};  // with this one, k + 2 steps of one size
  return request(filter((s.block_sum + log_c) / (s.block + 1), order), error, norm);
}

Control StepSmoother::request(double ratio, double error, double norm) const {
  const bool grows = 2.0 * error + 1e-4 <= 1.0;  // IDA's tmp >= 1
  if (!grows && ratio < 1.0) return {{1.0, kAnyRatio, kLargest, ratio}};
  if (!grows) return {{0.0, kAnyRatio}};
  if (ratio > 1.0) return {{1.0, 1.0, ratio}};
  if (!options_.step_smoothing) return reduce_by_weights(ratio, error, norm);
  return {{1.0, 1.0, kLargest, 0.0, now_->h * ratio}};
}

// IDA reduces h by any requested ratio if its own ratio is below 1, that is, for an error above
// 0.5. The weights are multiplied so that the error exceeds 0.5 but passes the test. The order,
// which compares errors, does not change.
Control StepSmoother::reduce_by_weights(double ratio, double error, double norm) const {
  constexpr double kReducing = 0.55, kPassed = 0.95;
  const double factor = kReducing / error;
  if (!(factor > 1.0) || factor * test_constant(now_->h, now_->order) * norm > kPassed)
    return {kHold};
  return {{1.0, kAnyRatio, kLargest, ratio}, factor};
}

}  // namespace tether::ida_projection
