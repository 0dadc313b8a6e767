// Tether: restitution that cannot create energy. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "near_contacts.hpp"

namespace tether::contact::detail {

/// README, section 14. First the contact problem without restitution, impulses x; then epsilon x at
/// the contacts that bounce; then the contact problem once more, for contacts which that pressed
/// together. What the last two add is scaled down where an island of bodies would end with more
/// energy than it had before the impulses.
class Restitution {
 public:
  Restitution(double threshold, const BodyOptions& options);

  /// Start of a step: velocities that bodies come with, before forces.
  void remember(const BodySet& bodies);
  /// After the contacts are found: chooses those that bounce. Their impact is now, bias 0.
  void choose(const NearContacts& near, const BodySet& bodies, double dt, StepContacts& contacts);
  /// After the first solve. Adds to velocities and impulses; returns the number of bounces.
  int apply(BodySet& bodies, StepContacts& contacts);

 private:
  struct Bounce {
    int contact;
    double part;  // of its impulse
  };
  int root(int body);
  void limit_energy(const BodySet& bodies, const StepContacts& contacts);

  double threshold_;
  std::vector<Bounce> bounces_;
  std::vector<RigidBody> coming_, before_, change_;
  std::vector<int> parent_;
  std::vector<double> constant_, linear_, square_, scale_;  // of each island; see limit_energy
  BodySolver solver_;
  BodySolution solution_;
};

}  // namespace tether::contact::detail
