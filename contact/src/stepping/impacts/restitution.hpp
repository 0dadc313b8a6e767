// Tether: restitution that cannot create energy. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "joints/cone_islands.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/moving_islands.hpp"

namespace tether::contact::detail {

/// The same without the impulses of the problem before.
BodyOptions cold(BodyOptions options);

/// Restitution (method, eq. 28). `newton`: bouncing contacts leave with epsilon times their speed
/// of approach, in one solve with friction. `poisson`: the contact problem without restitution
/// gives impulses x; epsilon x is added at bouncing contacts; then the contact problem is solved
/// once more. In both, the change by restitution is scaled down in islands that would gain more
/// energy than their forces, motors included, supply along the new velocities. Limits of joints
/// bounce as contacts do.
class Restitution {
 public:
  Restitution(RestitutionLaw law, const BodyOptions& options, ConeSources& sources, LawUse use);

  /// Selects the impacts that bounce. `chosen` has the velocities at the start, `bodies` those with
  /// the forces of the step; `limits` are the limits of joints that are struck.
  void choose(const Impacts& chosen, const std::vector<Strike>& limits, const BodySet& bodies,
              StepContacts& contacts);
  /// After the solve. Changes velocities and impulses; returns the number of bounces.
  int apply(BodySet& bodies, StepContacts& contacts);

  /// Warm start of its second solve.
  WarmStart warm_start() const { return solver_.warm_start(); }
  void set_warm_start(const WarmStart& start) { solver_.set_warm_start(start); }

 private:
  struct Bounce {
    int contact;
    double part;  // of the impulse that is given back
  };
  /// Velocities of body i in the second solve.
  Vector6d found(std::size_t i) const {
    Vector6d v;
    v << solution_.velocities[i], solution_.angular_velocities[i];
    return v;
  }
  void add_laws(bool plastic, const BodySet& bodies, std::vector<Vector6d>& forces) const;
  void sum_energies(const BodySet& bodies);
  bool gains_energy(const BodySet& bodies, const StepContacts& contacts);
  bool gains(int body) { return gains_[static_cast<std::size_t>(islands_.root(body))] != 0; }
  void add_impulses_again(BodySet& bodies, StepContacts& contacts);
  void solve_without(BodySet& bodies, StepContacts& contacts);
  void limit_energy(const BodySet& bodies);
  void add_change(BodySet& bodies, StepContacts& contacts);

  RestitutionLaw law_;
  std::vector<Bounce> bounces_;  // those that press, once the problem is solved
  std::vector<int> biased_;      // contacts
  std::vector<int> limits_;      // bodies of joints whose limits bounce
  ConeSources& sources_;
  // Velocities before the impulses, those that energy is compared with, what the forces of the step
  // add; what restitution adds to velocities without it, to those by motors, and to impulses.
  std::vector<RigidBody> before_, came_;
  std::vector<Vector6d> force_, change_, driven_, driven_change_;
  std::vector<Eigen::Vector3d> added_;
  MovingIslands islands_;
  std::vector<char> gains_;  // islands
  // One entry for each island, see sum_energies.
  std::vector<double> constant_, linear_, square_, kinetic_, scale_;
  std::vector<PointContact> points_;  // of those that gain, and which contacts they are
  std::vector<std::size_t> contact_;
  StepSolver solver_;
  BodySolution solution_;
};

}  // namespace tether::contact::detail
