// Tether: keeps IDA off the orders that excite oscillations. SPDX-License-Identifier: BSD-3-Clause
#include "step/order_limit.hpp"

#include <algorithm>
#include <cmath>

namespace tether::ida_projection {

namespace {

constexpr double kLogSmall = -1.2;  // of r: 0.3
constexpr int kSamples = 6;         // in the mean of log r
constexpr double kWorth = 0.5;      // of the step before it
constexpr long kWait = 100;         // steps, after a limit that did not pay
constexpr int kTries = 8;
constexpr double kPassed = 0.8;        // |ycor| / (k + 1), where IDA's test is not asked
constexpr double kUnderflow = 1e-200;  // its square, times any weight, is 0

}  // namespace

void OrderLimit::reset() {
  end();
  now_ = State();
  if (options_.advanced.limit_order) now_.phase = Phase::watching;
}

void OrderLimit::end() {
  if (now_.phase == Phase::lowering) settings_.set({});
  if (now_.phase == Phase::limited) settings_.limit_order(now_.highest);
  now_.phase = Phase::off;
}

// The mean of the latest log r: each new one replaces a mean one.
void OrderLimit::take_sample() {
  now_.samples = std::min(now_.samples + 1, kSamples);
  now_.mean =
      now_.samples == 1 ? *now_.pending : now_.mean + (*now_.pending - now_.mean) / now_.samples;
  now_.pending.reset();
}

// Compares y' of two successive steps.
void OrderLimit::compare_slopes(const Attempt& attempt, const Candidate& candidate,
                                N_Vector differential) {
  const bool keeps = attempt.steps % kEvery == 0;
  if (!keeps && !kept_slope_) return;
  if (!kept_slope_)
    for (OwnedVector* each : {&kept_slope_, &slope_}) *each = OwnedVector(candidate.base);
  N_VLinearSum(1.0, candidate.predicted_slope, attempt.cj, candidate.correction,
               keeps ? kept_slope_ : slope_);
  if (keeps) return;
  now_.pending.reset();
  if (attempt.order < (now_.phase == Phase::limited ? kLimit : kLimit + 1)) return;
  N_VLinearSum(1.0, slope_, -1.0, kept_slope_, slope_);
  const double ycor = error_norm(candidate.correction, candidate.weights, differential);
  const double curvature = attempt.h * error_norm(slope_, candidate.weights, differential);
  if (ycor > 0.0 && curvature > 0.0)
    now_.pending = std::log(ycor / curvature) / (attempt.order - 1);
}

void OrderLimit::watch(const Attempt& attempt) {
  if (now_.samples < kSamples || !(now_.mean >= now_.large) || attempt.steps < now_.not_before)
    return;  // also where the mean is no number
  ++now_.limits;
  now_.samples = 0;
  now_.phase = Phase::lowering;
  now_.tries = 0;
  now_.step_before = attempt.h;
}

// IDA lowers its order by one where that makes the estimated error no larger: weights that
// underflow make all estimates 0. Only where the error test would be passed: it is not made then.
Control OrderLimit::lower(const Attempt& attempt, const Candidate& candidate, N_Vector tested) {
  if (attempt.order <= kLimit) {
    now_.phase = Phase::limited;
    settings_.limit_order(kLimit);  // IDA never raises the order beyond a limit that it has reached
    now_.since = attempt.steps;
    now_.t_since = attempt.t;
    now_.pending.reset();
    return {};
  }
  if (now_.tries >= kTries) {  // something else, such as sensitivities, is in the error test
    end();
    return {};
  }
  const double norm = error_norm(candidate.correction, candidate.weights, tested);
  if (norm / (attempt.order + 1) > kPassed) return {};
  ++now_.tries;
  return {{1.0, kAnyRatio}, kUnderflow};
}

// Steps that became shorter tell that the limit does not pay; a vibration that a higher order
// excites grows, however long its steps are.
void OrderLimit::judge(const Attempt& attempt) {
  const long taken = attempt.steps - now_.since;
  if (taken != now_.trial) return;
  const double mean = std::abs(attempt.t - now_.t_since) / static_cast<double>(taken);
  const bool shorter = mean < kWorth * std::abs(now_.step_before);
  const bool pays_no_more = now_.samples == kSamples && now_.mean < kLogSmall;
  now_.since = attempt.steps;
  now_.t_since = attempt.t;
  if (!shorter && !pays_no_more) return;
  settings_.limit_order(now_.highest);
  now_.phase = Phase::watching;
  now_.samples = 0;
  now_.pending.reset();
  if (shorter)
    now_.not_before = attempt.steps + kWait;
  else
    now_.trial *= 2;
}

}  // namespace tether::ida_projection
