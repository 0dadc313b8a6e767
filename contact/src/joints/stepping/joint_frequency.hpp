// Tether: how fast bodies vibrate across the forces of their joints (method, section 7.1).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <tether/contact/joint_equations.hpp>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "joints/mechanisms.hpp"

namespace tether::contact::detail {

/// Joint forces F that turn with the bodies act as springs across their direction: a link of mass m
/// and length l that carries a load vibrates with w^2 = F / (m l). Impulses along the rows of the
/// start of a step hold this for w dt < 2 only, as of any explicit step. The largest w^2 is that of
/// P M^-1 d(G' F)/dx, with P the projection onto velocities that the joints allow: by the power
/// method with differences of the rows, which goes on from step to step.
class JointFrequency {
 public:
  /// Writes the rows of these bodies at time t, as many and on the same bodies as at first; throws.
  using RowsAt = std::function<void(const BodySet&, double t, JointRows& out)>;

  /// At the end of a step of length dt, with the factors of its rows and their impulses.
  void update(const RowsAt& rows_at, const JointRows& rows, const std::vector<double>& impulses,
              double acceleration, double t, double dt, Mechanisms& mechanisms,
              const BodySet& bodies);
  /// By what joints add in the step that begins.
  void follow(double acceleration);
  /// Whether a step of this length resolves how the frequency has changed since the last one ended:
  /// an explicit step knows the energy of a vibration up to a part of (w dt)^2.
  bool resolves_change(double dt) const;

  const StepperMemory::Vibration& memory() const { return memory_; }
  void set_memory(const StepperMemory::Vibration& memory) {
    memory_ = memory;
    at_end_ = memory.frequency;
  }

 private:
  double iterate(const RowsAt& rows_at, const JointRows& rows, const std::vector<double>& impulses,
                 double t, double dt, Mechanisms& mechanisms, const BodySet& bodies);
  double displace(const Mechanisms& mechanisms, const BodySet& bodies);

  StepperMemory::Vibration memory_;
  double at_end_ = 0;  // of the last step, 1/s
  BodySet then_;       // bodies, displaced along the mode
  std::vector<Vector6d> pull_;
  std::vector<double> u_;
  JointRows displaced_;
};

}  // namespace tether::contact::detail
