// Tether: sub-steps that keep an accuracy. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "stepping/step_halving.hpp"

namespace tether::contact::detail {

/// Error-controlled steps (method, section 7.1). Each sub-step is taken whole and in two halves. If
/// contacts behave alike in all three, 2 halves - whole is of order 2 (Deuflhard's extrapolation of
/// the Euler step); else the halves are kept. Lengths by H211b (Soederlind, Digital filters in
/// adaptive time-stepping, 2003).
class AccurateSteps {
 public:
  AccurateSteps(SubStepper& stepper, StepHalving& halving) : stepper_(stepper), halving_(halving) {}

  void take(double start, double length);

  StepperMemory::Control control;  ///< how the next step goes on

 private:
  enum class Behaviour : std::uint8_t {
    sticks,
    slips,
    strikes,
    rolls,
    rolls_not,
    spins,
    spins_not
  };
  /// Behaviour of a contact, a law of a joint or a moment in a sub-step.
  struct Active {
    std::uint64_t id;
    Behaviour behaviour;
    Eigen::Vector3d slip;  // impulse, or moment, against it
    // A contact's mean normal force and mean distance from the cone; speed of slip at the end;
    // size.
    double force = 0, margin = 0, speed = 0, size = 0;
    Eigen::Vector3d came = Eigen::Vector3d::Zero();  // slip at the start
  };
  struct Moment {
    double when, early;  // s
  };
  bool advance(double time, double length);
  double take_sub_step(double time, double length, bool shortened, double shortest);
  bool take_halves(double time, double length);
  void accept(double time, double length, double error, bool smooth, bool cut);
  Moment moment(double gap, double came, double comes, double size, double length) const;
  Moment moment(const Impact& i, double length) const;
  void list_active(double length, std::vector<Active>& list) const;
  void list_laws(double length, std::vector<Active>& list) const;
  void list_moments(std::vector<Active>& list) const;
  static bool same(const std::vector<Active>& a, const std::vector<Active>& b);
  double first_impact(double length, double& at_once) const;
  double first_switch(double length) const;
  double error(double length, bool smooth) const;
  void extrapolate();

  SubStepper& stepper_;
  StepHalving& halving_;
  BodiesState before_, whole_;  // a sub-step: before it, and after it whole
  std::array<std::vector<Active>, 3> active_;
  // Contacts of the second half of the sub-step before this one, in the same step; its length.
  std::vector<Active> past_;
  double past_length_ = 0;
};

}  // namespace tether::contact::detail
