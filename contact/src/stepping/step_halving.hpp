// Tether: sub-steps whole, in halves, or cut. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/step_cutting.hpp"
#include "stepping/sub_stepper.hpp"

namespace tether::contact::detail {

/// Takes a sub-step, in halves, quarters, ... if its contact problem is not solved or its joints
/// are not met. An impact within it cuts it (StepCutting).
class StepHalving {
 public:
  explicit StepHalving(SubStepper& stepper)
      : stepper_(stepper), cutting_(stepper, [this](const SubStep& s) { return advance(s); }) {}

  SubStep whole(double start, double length) const;
  /// Returns how many cuts are left.
  int advance(SubStep s);
  /// How often joints have halved a sub-step so far.
  long halved_by_joints() const { return halved_by_joints_; }

 private:
  int take_halves(const SubStep& s);

  SubStepper& stepper_;
  StepCutting cutting_;
  long halved_by_joints_ = 0;
};

}  // namespace tether::contact::detail
