// Tether: the kind of projection of an attempt between full ones. SPDX-License-Identifier:
// BSD-3-Clause
#include "step/frequency.hpp"

#include <algorithm>

namespace tether::ida_projection {

namespace {

constexpr double kUnfelt = 3e-3;                  // tolerances: a jump by so much disturbs no order
constexpr long kPause = 8, kLongestPause = 1000;  // steps

}  // namespace

FrequencyPolicy::Need FrequencyPolicy::need(long steps, bool repeated, double h) {
  if (repeated) {
    pause_ = steps < paused_until_ + 4 * pause_ ? std::min(2 * pause_, kLongestPause) : kPause;
    paused_until_ = steps + pause_;
  }
  if (!on() || steps < paused_until_ || (steps + 1) % every_ == 0) return Need::projection;
  if (!known_ || alone_ >= allowed_ || h > h_ * (1.0 + 1e-9)) return Need::chord;
  // Twice: the drift need not grow evenly.
  return 2.0 * rate_ * (alone_ + 1) <= kUnfelt ? Need::nothing : Need::chord;
}

void FrequencyPolicy::looked(double length, double h) {
  rate_ = length / (alone_ + 1);
  allowed_ = known_ && h <= h_ * (1.0 + 1e-9) ? 2 * alone_ + 1 : 0;
  known_ = true;
  alone_ = 0;
  h_ = h;
}

}  // namespace tether::ida_projection
