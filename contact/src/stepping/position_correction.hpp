// Tether: moves of a step that are no velocities. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/impacts/closing.hpp"
#include "stepping/motion/joint_part.hpp"

namespace tether::contact::detail {

/// Closes the gaps that inelastic impacts leave, and takes penetrations back (method, section 7).
class PositionCorrection {
 public:
  PositionCorrection(const SteppingOptions& options);

  void set_joints(IslandMaker& joints, const SteppingOptions& options);

  /// After the solve of velocities.
  void close_gaps(const Impacts& impacts, double dt, const StepContacts& contacts,
                  const std::vector<int>& moving, BodySet& bodies);
  /// The least move (in the metric of the masses) that takes penetrations deeper than `negligible`
  /// back; contacts that are open may close by as much as they are open. Islands whose gaps have
  /// just been closed are left out: that has taken theirs back.
  void take_back(double deepest, double negligible, double dt, const StepContacts& contacts,
                 const std::vector<int>& moving, BodySet& bodies);

  WarmStart warm_start() const { return solver_.warm_start(); }
  void set_warm_start(const WarmStart& start) { solver_.set_warm_start(start); }

 private:
  Depenetration depenetration_;
  Closing closing_;
  bool closes_ = false;
  std::vector<RigidBody> closing_move_;
  StepSolver solver_;
  BodySolution solution_;
  std::vector<RigidBody> at_rest_;
  std::vector<PointContact> points_;
};

}  // namespace tether::contact::detail
