// Tether: sub-steps that are cut at impacts. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "stepping/sub_stepper.hpp"

namespace tether::contact::detail {

/// Takes a sub-step in three parts: up to the impact that StepCuts has chosen, the impact, the
/// rest. This holds for the islands that strike; others take it whole. Impulses are sums over the
/// parts.
class StepCutting {
 public:
  /// Takes a sub-step, and returns how many cuts are left.
  using Advance = std::function<int(const SubStep&)>;
  StepCutting(SubStepper& stepper, Advance advance)
      : stepper_(stepper), advance_(std::move(advance)) {}

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

  SubStepper& stepper_;
  Advance advance_;
  BodiesState before_;                   // an approach
  std::vector<RigidBody> before_turns_;  // before impacts in turn
};

}  // namespace tether::contact::detail
