// Tether: the step size at which the corrector failed. SPDX-License-Identifier: BSD-3-Clause
#include "step/refused_size.hpp"

#include <ida/ida.h>

#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kAlike = 0.9;    // of the size that was refused: as good as that
constexpr int kHighestOrder = 2;  // beyond it orders excite oscillations that failures hold down

}  // namespace

void RefusedSize::forget() {
  refused_ = 0.0;
  hold(false);
}

void RefusedSize::control(long steps, double h, int order) {
  if (h != h_ || order != order_)
    same_ = 1;
  else if (steps > steps_)
    ++same_;
  steps_ = steps;
  h_ = h;
  order_ = order;
  if (refused_ == 0.0) return;
  if (same_ >= order + 2) return forget();
  hold(order <= kHighestOrder && 2.0 * h >= kAlike * refused_);
}

void RefusedSize::hold(bool wanted) {
  if (wanted == holding_) return;
  holding_ = wanted;
  IDASetEtaFixedStepBounds(ida_mem_, 1.0, wanted ? kAnyRatio : 2.0);
}

}  // namespace tether::ida_projection
