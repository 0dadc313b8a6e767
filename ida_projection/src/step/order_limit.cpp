// Tether: keeps IDA off the orders that excite oscillations. SPDX-License-Identifier: BSD-3-Clause
#include "step/order_limit.hpp"

#include <algorithm>
#include <cmath>
#include <ida/ida.h>

#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kLogLarge = -0.36, kLogSmall = -1.2;  // of r: 0.7, 0.3
constexpr double kLogLargeIfStiff = -0.6;              // 0.55
constexpr int kSamples = 6, kSamplesAgain = 3;         // in the mean
constexpr long kEarly = 10, kTrial = 40;          // steps with the limit; it is judged after them
constexpr double kStopBelow = 0.5, kWorth = 0.9;  // of the step before it
constexpr double kPatience = 0.5;                 // factor of these where vibrations are likely
constexpr long kFirstSteps = 60;                  // steps in which a start excites stiff components
constexpr long kFirstWait = 100;                  // steps, after a limit that did not pay
constexpr int kTries = 8;
constexpr double kPassed = 0.8;        // |ycor| / (k + 1) below which the error test is passed
constexpr double kUnderflow = 1e-200;  // weights so small that squares of errors underflow to 0

}  // namespace

void OrderLimit::reset() {
  end();
  on_ = wanted_;
  stiff_ = false;
  begun_ = 0;
  early_ = acted_early_ = false;
  pending_steps_ = -1;
  samples_ = highest_ = 0;
  kept_ = false;
  not_before_ = 0;
  wait_ = kFirstWait;
  duration_ = 1;
}

void OrderLimit::end() {
  if (phase_ == Phase::lowering) hold_step(false);
  if (phase_ == Phase::limited) IDASetMaxOrd(ida_mem_, highest_);
  phase_ = Phase::watching;
  on_ = false;
}

void OrderLimit::note_differences(long steps, double ycor, double curvature) {
  int order = 1;
  IDAGetCurrentOrder(ida_mem_, &order);
  pending_steps_ = -1;
  if (order < (phase_ == Phase::limited || at_start(steps) ? kLimit : 3)) return;
  if (!(ycor > 0.0) || !(curvature > 0.0)) return;
  pending_ = std::log(ycor / curvature) / (order - 1);
  pending_steps_ = steps;
}

// Updates the mean of the latest log r; each sample replaces a mean one.
void OrderLimit::take_sample(long steps, int most) {
  if (pending_steps_ < 0 || steps <= pending_steps_) return;
  pending_steps_ = -1;
  if (samples_ >= most) {
    mean_ += (pending_ - mean_) / most;
  } else {
    mean_ = samples_ == 0 ? pending_ : (samples_ * mean_ + pending_) / (samples_ + 1);
    ++samples_;
  }
}

double OrderLimit::control(long steps, double t, double norm) {
  if (!on_) return 1.0;
  int order = 1;
  IDAGetCurrentOrder(ida_mem_, &order);
  highest_ = std::max(highest_, order);
  if (phase_ == Phase::watching)
    watch(steps, order);
  else if (phase_ == Phase::limited)
    judge(steps, t);
  else
    return lower(order, steps, t, norm);
  return 1.0;
}

// A start excites stiff components, which orders 3 and 4, that IDA reaches after a few steps, do
// not damp.
bool OrderLimit::at_start(long steps) const {
  return stiff_ && steps < kFirstSteps && begun_ == (acted_early_ ? 1 : 0);
}

void OrderLimit::watch(long steps, int order) {
  const int needed = kept_ ? kSamplesAgain : kSamples;
  take_sample(steps, needed);
  early_ = at_start(steps) && order > kLimit && (samples_ == 0 || mean_ > kLogLargeIfStiff);
  if (early_) {
    phase_ = Phase::lowering;
    if (!acted_early_) ++begun_;
    acted_early_ = true;
    tries_ = 0;
    return;
  }
  if (samples_ < needed || mean_ < (stiff_ ? kLogLargeIfStiff : kLogLarge) || steps < not_before_ ||
      order <= kLimit)
    return;
  phase_ = Phase::lowering;
  ++begun_;
  tries_ = samples_ = 0;
  IDAGetCurrentStep(ida_mem_, &step_before_);
}

// IDA lowers its order by one if that does not increase the estimated error. Weights that underflow
// make all estimates 0, and the error test void. They are used only where the test would be passed.
double OrderLimit::lower(int order, long steps, double t, double norm) {
  if (order <= kLimit && early_) {
    hold_step(false);
    phase_ = Phase::watching;
    return 1.0;
  }
  if (order <= kLimit) {
    // IDA never raises the order beyond a limit that it has reached.
    IDASetMaxOrd(ida_mem_, kLimit);
    hold_step(false);
    phase_ = Phase::limited;
    since_ = steps;
    t_since_ = t;
    trials_ = 0;
    samples_ = 0;
    pending_steps_ = -1;
    return 1.0;
  }
  if (tries_ >= kTries) {  // IDA's estimates contain something else, such as sensitivities
    end();
    return 1.0;
  }
  const bool passed = norm / (order + 1) <= kPassed;
  hold_step(passed);
  if (!passed) return 1.0;
  ++tries_;
  return kUnderflow;
}

void OrderLimit::judge(long steps, double t) {
  take_sample(steps, kSamples);
  const long taken = steps - since_;
  const bool early = taken == kEarly && trials_ == 0;
  if (taken != kTrial && !early) return;
  const double mean = std::abs(t - t_since_) / static_cast<double>(taken);
  // A vibration that a higher order excites grows, so that longer steps of that order do not pay.
  const double patience = stiff_ ? kPatience : 1.0;
  if (mean < patience * (trials_ > 0 ? kWorth : kStopBelow) * std::abs(step_before_))
    return release(steps, wait_);
  if (early) return;
  kept_ = kept_ || trials_ > 0;  // the first may pass before the oscillation is damped
  since_ = steps;
  t_since_ = t;
  if (++trials_ >= duration_ && samples_ == kSamples && mean_ < kLogSmall) release(steps, 0);
}

void OrderLimit::release(long steps, long wait) {
  IDASetMaxOrd(ida_mem_, highest_);
  phase_ = Phase::watching;
  samples_ = 0;
  pending_steps_ = -1;
  if (wait == 0) {
    duration_ *= 2;
  } else {
    kept_ = false;
    not_before_ = steps + wait;
    if (!stiff_) wait_ *= 4;
  }
}

void OrderLimit::hold_step(bool hold) {
  IDASetEtaFixedStepBounds(ida_mem_, 1.0, hold ? kAnyRatio : 2.0);
}

}  // namespace tether::ida_projection
