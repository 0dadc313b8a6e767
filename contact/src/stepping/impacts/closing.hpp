// Tether: gaps that inelastic impacts close. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/joint_part.hpp"
#include "stepping/motion/moving_islands.hpp"

namespace tether::contact::detail {

/// See SteppingOptions.
struct Depenetration {
  double error_reduction, max_speed;
  /// Velocity at which a contact may close, or, negative, at which it has to open.
  double bias(double gap, double dt) const {
    return gap > 0 ? gap / dt : std::max(error_reduction * gap / dt, -max_speed);
  }
};

/// An impact that does not bounce takes all of the approach at once and would leave its gap open.
/// Positions of its island move as if it only stopped the approach at the surface (bias gap / dt);
/// what they move more or less than the velocities is no velocity. Penetrations of such islands are
/// taken back in the same solve. method, section 7.
class Closing {
 public:
  Closing(const BodyOptions& options, const Depenetration& depenetration)
      : depenetration_(depenetration), solver_(options) {}

  void set_joints(IslandMaker& joints, const BodyOptions& options) {
    solver_.set_joints(joints.make_islands(options, LawUse::closing));
    islands_.set_links(joints.links());
  }

  /// After the solve. Fills `move`: velocities to add for this step; false: there are none.
  bool find(const Impacts& impacts, const BodySet& bodies, double dt, const StepContacts& contacts,
            std::vector<RigidBody>& move);
  /// After find() was true: contacts that it has treated.
  bool treats(const BodySet& bodies, const PointContact& c) {
    return marked_[static_cast<std::size_t>(islands_.root(bodies, c))] != 0;
  }

 private:
  Depenetration depenetration_;
  std::vector<Impact> closes_;
  std::vector<int> bounces_;  // contacts
  std::vector<char> marked_;  // islands
  std::vector<double> part_;  // of the impulse that is left, for each contact
  MovingIslands islands_;
  std::vector<PointContact> points_;
  WarmStart start_;
  StepSolver solver_;
  BodySolution solution_;
};

}  // namespace tether::contact::detail
