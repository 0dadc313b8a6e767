// Tether: gaps that inelastic impacts close. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/impacts.hpp"
#include "stepping/moving_islands.hpp"
#include "stepping/near_contacts.hpp"

namespace tether::contact::detail {

/// An impact that does not bounce takes all of the approach at once and would leave its gap open.
/// Positions of its island move as if it only stopped the approach at the surface (bias gap / dt);
/// what they move more or less than the velocities is no velocity. README, section 13.
class Closing {
 public:
  explicit Closing(const BodyOptions& options) : solver_(options) {}

  /// After the impacts are chosen, before the solve: velocities with the forces of the step.
  void begin(const std::vector<Impact>& impacts, const BodySet& bodies,
             const StepContacts& contacts);
  /// After the solve. Fills `move`: velocities to add for this step; false: there are none.
  bool find(const BodySet& bodies, double dt, const StepContacts& contacts,
            std::vector<RigidBody>& move);

  /// All that one step leaves to the next.
  WarmStart warm_start() const { return solver_.warm_start(); }
  void set_warm_start(const WarmStart& start) { solver_.set_warm_start(start); }

 private:
  std::vector<RigidBody> free_;
  std::vector<int> closes_, bounces_;  // contacts
  std::vector<char> marked_;           // islands
  MovingIslands islands_;
  std::vector<PointContact> points_;
  WarmStart start_;
  BodySolver solver_;
  BodySolution solution_;
};

}  // namespace tether::contact::detail
