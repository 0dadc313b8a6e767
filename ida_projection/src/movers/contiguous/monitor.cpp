// Tether: convergence monitor of the projection's Newton moves.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "movers/mover.hpp"

namespace tether::ida_projection {

Monitor::Verdict Monitor::judge(double length, bool fresh, double floor) {
  ++moves_;
  if (!std::isfinite(length)) return Verdict::failed;
  const bool last = moves_ >= options_->advanced.maximum_iterations;

  if (moves_ == 1) {
    previous_ = length;
    if (length <= floor) return Verdict::done;
    if (!measures(length) && 4.0 * theta_ * length * length <= options_->advanced.tolerance)
      return Verdict::done;
    if (last) return length <= options_->advanced.tolerance ? Verdict::done : Verdict::failed;
    return Verdict::go_on;
  }

  const double ratio = length / previous_;
  if (moves_ == 2) measured_ = std::max(measured_, previous_);
  // Only a clean second move says something about curvature: not one made of rounding.
  if (moves_ == 2 && length > 10.0 * floor)
    theta_ = std::max(theta_, length / (previous_ * previous_));
  else if (theta_ < 0.0)
    theta_ = 0.0;
  previous_ = length;

  // The rest is at most about length * ratio, and no more than length while ratio <= 1/2.
  if (ratio <= 0.5) {
    if (length * ratio <= options_->advanced.tolerance) return Verdict::done;
    return last ? Verdict::failed : Verdict::go_on;
  }
  // No longer halving: rounding (then nothing can be gained) or a broken iteration.
  if (length <= std::max({floor, 1e-5, 0.1 * std::min(1.0, options_->advanced.tolerance)}))
    return Verdict::done;
  if (!fresh && !last) return Verdict::refactor;
  return Verdict::failed;
}

}  // namespace tether::ida_projection
