// Tether: moves of a step that are no velocities. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "joints/cone_islands.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/moving_islands.hpp"

namespace tether::contact::detail {

/// Closes the gaps that inelastic impacts leave, and takes penetrations back (method, section 7).
class PositionCorrection {
 public:
  PositionCorrection(const SteppingOptions& options, ConeSources& sources);

  /// Called after the solve of velocities. An impact without restitution stops the approach at once
  /// and would leave its gap open. The positions of its island move as if the approach ended at the
  /// surface (bias gap / dt); this displacement is applied to positions only. Penetrations of such
  /// islands are reduced in the same solve.
  /// free: velocities with the forces of the step, before impulses.
  void close_gaps(const Impacts& impacts, const std::vector<RigidBody>& free, double dt,
                  const StepContacts& contacts, const std::vector<int>& moving, BodySet& bodies);
  /// The least displacement, in the metric of the masses, that reduces penetrations deeper than
  /// `negligible`; open contacts may close. Islands whose gaps have just been closed are left out.
  void take_back(double deepest, double negligible, double dt, const StepContacts& contacts,
                 const std::vector<int>& moving, BodySet& bodies);

  WarmStart warm_start() const { return solver_.warm_start(); }
  void set_warm_start(const WarmStart& start) { solver_.set_warm_start(start); }

 private:
  bool find_closing(const Impacts& impacts, const StepContacts& contacts, const BodySet& bodies);
  void solve_closing(const std::vector<RigidBody>& free, double dt, const StepContacts& contacts);
  double bias(double gap, double dt) const;

  double error_reduction_, max_speed_;
  std::vector<Impact> closing_;
  std::vector<char> closed_;        // contacts of islands whose gaps are closed; empty: none
  std::vector<char> closing_body_;  // bodies of these
  std::vector<double> part_;        // of its impulse that is left to a contact
  MovingIslands islands_;
  WarmStart start_;
  StepSolver closing_solver_, solver_;
  BodySolution solution_;
  std::vector<RigidBody> at_rest_;
  std::vector<PointContact> points_;
};

}  // namespace tether::contact::detail
