// Tether: how far a run leaves its invariants. SPDX-License-Identifier: BSD-3-Clause
#include "drift_history.hpp"

#include <algorithm>
#include <cmath>

namespace pendulum {

namespace {

constexpr int kWindows = 90;
constexpr double kFirstWindow = 1e-4;  // ends at this share of the duration

// Written so that a NaN stays visible.
void keep_larger(double& largest, double value) {
  if (!(value <= largest)) largest = value;
}

}  // namespace

DriftHistory::DriftHistory(const Experiment& experiment)
    : length_(experiment.length),
      gravity_(experiment.gravity),
      first_(kFirstWindow * experiment.duration),
      duration_(experiment.duration),
      windows_(kWindows) {}

void DriftHistory::add(double t, const double* y) {
  const double share = std::log(t / first_) / std::log(duration_ / first_);
  const int k = std::clamp(static_cast<int>(std::ceil(share * (kWindows - 1))), 0, kWindows - 1);
  Drift& window = windows_[static_cast<std::size_t>(k)];
  window.t = t;
  keep_larger(window.length, std::abs(std::hypot(y[0], y[1]) - length_));
  keep_larger(window.energy, std::abs((y[2] * y[2] + y[3] * y[3]) / 2.0 + gravity_ * y[1]));
}

Drift DriftHistory::largest() const {
  Drift result;
  for (const Drift& window : windows_) {
    keep_larger(result.t, window.t);
    keep_larger(result.length, window.length);
    keep_larger(result.energy, window.energy);
  }
  return result;
}

std::vector<Drift> DriftHistory::windows() const {
  std::vector<Drift> used;
  std::copy_if(windows_.begin(), windows_.end(), std::back_inserter(used),
               [](const Drift& window) { return window.t > 0.0; });
  return used;
}

}  // namespace pendulum
