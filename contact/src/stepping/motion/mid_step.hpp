// Tether: contacts in the middle of a step (method, eq. 27). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"

namespace tether::contact::detail {

class StepJoints;

/// A step moves bodies by one velocity v. Bodies that stick or roll and turn keep to their way in
/// order 2 where contacts hold in the middle of the step,
///
///     J(t + dt/2) v(t + dt/2) = J(t) v + d,
///
/// with d as free motion has it, from the velocities at the start; joints have added to theirs
/// what turns the bodies that they hold. Impulses act along J(t)', so that the step is symmetric in
/// time, as SHAKE is: energy has no drift of order 1. d is 0 where neither body turns by more than
/// its orientation is rounded.
class MidStep {
 public:
  /// Adds d to the contacts, but for the impacts, which are at the start.
  void turn(NearContacts& near, const Impacts& impacts, const BodySet& bodies,
            const StepJoints* joints, Gyroscopic gyroscopic, double dt,
            std::vector<PointContact>& contacts);

 private:
  void move(int body, const RigidBody& before, const BodySet& bodies, Gyroscopic gyroscopic,
            double half);
  const PointContact* find(std::uint64_t id);

  BodySet then_;  // bodies that have been moved, without inertias
  std::vector<char> moved_;
  StepContacts found_;    // points of two surfaces in the middle of the step
  std::size_t next_ = 0;  // of them: where find() begins
};

}  // namespace tether::contact::detail
