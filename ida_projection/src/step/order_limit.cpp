// Tether: keeps IDA off the orders that excite oscillations. SPDX-License-Identifier: BSD-3-Clause
#include "step/order_limit.hpp"

#include <algorithm>
#include <cmath>
#include <ida/ida.h>
#include <utility>

#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kLogLarge = -0.36, kLogLargeIfStiff = -0.6;  // of r: 0.7, 0.55
constexpr double kLogSmall = -1.2;                            // 0.3
constexpr int kSamples = 6;                                   // in the mean of log r
constexpr double kWorth = 0.5;                                // of the step before it
constexpr long kFirstSteps = 60;                              // a start excites what is stiff
constexpr long kWait = 100;  // steps, after a limit that did not pay
constexpr int kTries = 8;
constexpr double kPassed = 0.8;        // |ycor| / (k + 1), where IDA's test is not asked
constexpr double kUnderflow = 1e-200;  // its square, times any weight, is 0

}  // namespace

void OrderLimit::reset() {
  end();
  now_ = State();
  now_.on = options_.advanced.limit_order;
}

void OrderLimit::end() {
  if (now_.phase == Phase::lowering) hold_step(false);
  if (now_.phase == Phase::limited) IDASetMaxOrd(ida_mem_, now_.highest);
  now_.phase = Phase::watching;
  now_.on = false;
}

void OrderLimit::note_differences(long steps, double ycor, double curvature) {
  int order = 1;
  IDAGetCurrentOrder(ida_mem_, &order);
  now_.pending_steps = -1;
  if (order < (now_.phase == Phase::limited || at_start(steps) ? kLimit : 3)) return;
  if (!(ycor > 0.0) || !(curvature > 0.0)) return;
  now_.pending = std::log(ycor / curvature) / (order - 1);
  now_.pending_steps = steps;
}

// The mean of the latest log r: each new one replaces a mean one.
void OrderLimit::take_sample(long steps) {
  if (now_.pending_steps < 0 || steps <= now_.pending_steps) return;
  now_.pending_steps = -1;
  now_.samples = std::min(now_.samples + 1, kSamples);
  now_.mean =
      now_.samples == 1 ? now_.pending : now_.mean + (now_.pending - now_.mean) / now_.samples;
}

double OrderLimit::control(long steps, double t, double norm) {
  if (!now_.on) return 1.0;
  int order = 1;
  IDAGetCurrentOrder(ida_mem_, &order);
  now_.highest = std::max(now_.highest, order);
  if (now_.phase == Phase::lowering) return lower(order, steps, t, norm);
  take_sample(steps);
  if (now_.phase == Phase::watching)
    watch(steps, order);
  else
    judge(steps, t);
  return 1.0;
}

// A start excites what is stiff; orders 3 and 4, which IDA has after a few steps, keep that up.
bool OrderLimit::at_start(long steps) const {
  return now_.stiff && steps < kFirstSteps && now_.begun == (now_.acted_early ? 1 : 0);
}

void OrderLimit::watch(long steps, int order) {
  if (order <= kLimit) return;
  const double large = now_.stiff ? kLogLargeIfStiff : kLogLarge;
  now_.early = at_start(steps) && (now_.samples == 0 || now_.mean > large);
  const bool seen = now_.samples == kSamples && now_.mean >= large && steps >= now_.not_before;
  if (!now_.early && !seen) return;
  if (!now_.early || !std::exchange(now_.acted_early, true)) ++now_.begun;
  if (!now_.early) now_.samples = 0;
  now_.phase = Phase::lowering;
  now_.tries = 0;
  IDAGetCurrentStep(ida_mem_, &now_.step_before);
}

// IDA lowers its order by one where that makes the estimated error no larger: weights that
// underflow make all estimates 0. Only where the error test would be passed: it is not made then.
double OrderLimit::lower(int order, long steps, double t, double norm) {
  if (order <= kLimit) {
    hold_step(false);
    now_.phase = now_.early ? Phase::watching : Phase::limited;
    if (now_.early) return 1.0;
    // IDA never raises the order beyond a limit that it has reached.
    IDASetMaxOrd(ida_mem_, kLimit);
    now_.since = steps;
    now_.t_since = t;
    now_.pending_steps = -1;
    return 1.0;
  }
  if (now_.tries >= kTries) {  // something else, such as sensitivities, is in the error test
    end();
    return 1.0;
  }
  const bool passed = norm / (order + 1) <= kPassed;
  hold_step(passed);
  if (passed) ++now_.tries;
  return passed ? kUnderflow : 1.0;
}

// Steps that became shorter tell that the limit does not pay; a vibration that a higher order
// excites grows, however long its steps are.
void OrderLimit::judge(long steps, double t) {
  const long taken = steps - now_.since;
  if (taken != now_.trial) return;
  const double mean = std::abs(t - now_.t_since) / static_cast<double>(taken);
  const bool shorter = mean < kWorth * std::abs(now_.step_before);
  const bool pays_no_more = now_.samples == kSamples && now_.mean < kLogSmall;
  now_.since = steps;
  now_.t_since = t;
  if (!shorter && !pays_no_more) return;
  IDASetMaxOrd(ida_mem_, now_.highest);
  now_.phase = Phase::watching;
  now_.samples = 0;
  now_.pending_steps = -1;
  if (shorter) now_.not_before = steps + kWait;
  if (!shorter) now_.trial *= 2;
}

void OrderLimit::hold_step(bool hold) {
  IDASetEtaFixedStepBounds(ida_mem_, 1.0, hold ? kAnyRatio : 2.0);
}

}  // namespace tether::ida_projection
