// Tether: the kind of projection of an attempt between full ones. SPDX-License-Identifier:
// BSD-3-Clause
#include "step/frequency.hpp"

#include <algorithm>

namespace tether::ida_projection {

namespace {

constexpr double kUnfelt = 3e-3;             // tolerances: a jump by so much disturbs no order
constexpr double kForget = 0.1;              // of the drift of a step, at each look
constexpr double kGrown = 1.2;               // of the step
constexpr long kMostAlone = 3, kQuiet = 32;  // steps left alone in a row; steps without a rejection
constexpr long kStart = 16;                  // steps in which h does not grow
constexpr long kPause = 8, kLongestPause = 1000;  // steps

}  // namespace

FrequencyPolicy::Need FrequencyPolicy::need(long steps, bool repeated, double h, bool moved) {
  if (repeated) {
    repeated_at_ = steps;
    pause_ = steps < paused_until_ + 4 * pause_ ? std::min(2 * pause_, kLongestPause) : kPause;
    paused_until_ = steps + pause_;
  }
  // Corrections, and the metric made of them, grow with the power k + 1 of h.
  const bool grown = h > kGrown * full_h_;
  if (grown && steps < started_) started_ = steps + kStart;
  const bool starting = moved && steps < started_;
  if (!on() || starting || steps < paused_until_ || (steps + 1) % every_ == 0)
    return Need::projection;
  const long most = std::max(kMostAlone, (steps - repeated_at_) / kQuiet);
  const bool looked_at = known_ && alone_ < allowed_ && alone_ < most && h <= h_ * (1.0 + 1e-9);
  // Twice: the drift need not grow evenly.
  if (looked_at && 2.0 * rate_ * (alone_ + 1) <= kUnfelt) return Need::nothing;
  return grown ? Need::projection : Need::chord;
}

void FrequencyPolicy::looked(double length, double h) {
  rate_ = std::max(length / (alone_ + 1), kForget * rate_);  // drift passes through zeros, too
  allowed_ = known_ && h <= h_ * (1.0 + 1e-9) ? 2 * alone_ + 1 : 0;
  known_ = true;
  alone_ = 0;
  h_ = h;
}

}  // namespace tether::ida_projection
