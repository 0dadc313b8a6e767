// Tether: sub-steps whole, in halves, or cut. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/step_halving.hpp"

namespace tether::contact::detail {

// The vibration w^2 of loads on joints grows with the mass ratio of load and link, and with the
// shock of a slack chain that snaps taut. Each of 24 halvings allows four times as much; the last
// four resolve how w changes, to w dt of a tenth.
SubStep StepHalving::whole(double start, double length) const {
  return {start, length, stepper_.options.max_halvings, 24, stepper_.cuts ? StepCuts::kMost : 0};
}

int StepHalving::advance(SubStep s) {
  stepper_.set_now(s);
  if (stepper_.acting_joints && s.joint_halvings > 0 && !stepper_.resolves_joints()) {
    ++halved_by_joints_;
    --s.joint_halvings;
    return take_halves(s);
  }
  const SubStepEnd end = stepper_.take();
  if (end == SubStepEnd::whole) return s.cuts;
  stepper_.bodies.motion = stepper_.impacts->coming();
  if (end == SubStepEnd::cut) return cutting_.take(s);
  if (end == SubStepEnd::woken) return advance(s);
  if (end == SubStepEnd::unmet) {
    ++halved_by_joints_;
    --s.joint_halvings;
  } else {
    stepper_.solver->take_back();
    --s.halvings;
  }
  return take_halves(s);
}

int StepHalving::take_halves(const SubStep& s) {
  const double half = s.length / 2;
  if (stepper_.solver) stepper_.solver->scale_warm_start(0.5);
  ++stepper_.counts.halved;
  SubStep second = s.over(s.start + half, half);
  second.cuts = advance(s.over(s.start, half));
  const int left = advance(second);
  if (stepper_.solver) stepper_.solver->scale_warm_start(2);
  return left;
}

}  // namespace tether::contact::detail
