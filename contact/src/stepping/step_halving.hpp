// Tether: sub-steps whole, in halves, or cut. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "stepping/sub_stepper.hpp"

namespace tether::contact::detail {

class StepHalving;

/// Takes a sub-step in three parts: up to the impact that StepCuts has chosen, the impact, the
/// rest. This holds for the islands that strike; others take it whole. Impulses are sums over the
/// parts.
class StepCutting {
 public:
  StepCutting(SubStepper& stepper, StepHalving& halving) : stepper_(stepper), halving_(halving) {}

  /// Returns how many cuts are left.
  int take(const SubStep& s);

 private:
  enum class Struck : std::uint8_t { nothing, impact, unsolved };

  int take_islands(const SubStep& s);
  int take_striking(const SubStep& s);
  int take_others(const StepMark& start, const std::vector<char>& striking, const SubStep& s);
  double approach(const SubStep& s);
  int take_side(const SubStep& s, SubStep::Side side, double length);
  Struck strike();
  bool take_impact();
  bool take_impacts_in_turn();
  void add_joint_impulses();

  SubStepper& stepper_;
  StepHalving& halving_;
  BodiesState before_;                       // an approach
  std::vector<RigidBody> before_turns_;      // before impacts in turn
  std::vector<double> joint_sum_, law_sum_;  // impulses of the step, up to now
};

/// Takes a sub-step, in halves, quarters, ... if its contact problem is not solved or its joints
/// are not met. An impact within it cuts it (StepCutting).
class StepHalving {
 public:
  explicit StepHalving(SubStepper& stepper) : stepper_(stepper), cutting_(stepper, *this) {}
  StepHalving(const StepHalving&) = delete;  // its member refers to it
  StepHalving& operator=(const StepHalving&) = delete;

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
