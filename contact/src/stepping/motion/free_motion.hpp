// Tether: the motion of bodies in a step, without contacts and joints (method, eq. 26).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "stepping/motion/moving_islands.hpp"
#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

class StepJoints;

/// Which bodies move, and how each of them does: gravity, the gyroscopic term, the places that
/// velocities take them to. Joints move the bodies that they hold themselves.
class FreeMotion {
 public:
  /// Lists the bodies anew; joints may be null.
  void list(const BodySet& bodies, const StepJoints* joints, Gyroscopic gyroscopic);

  const std::vector<int>& moving() const { return moving_; }
  bool any_long() const { return !long_.empty(); }  ///< of inertia other than 1
  bool any_free_round() const { return !free_round_.empty(); }
  bool any_free_long() const { return !free_long_.empty(); }

  void accelerate(const Eigen::Vector3d& dv, BodySet& bodies) const;
  /// Between the weight and all other forces, and behind these.
  void remember_weight(const BodySet& bodies);
  void find_falling(const BodySet& bodies);
  /// The gyroscopic term by an explicit or an implicit step.
  void gyrate(Gyroscopic how, double dt, BodySet& bodies) const;

  void move(double dt, BodySet& bodies) const;
  /// No other force than its weight acts upon it, and no joint holds it.
  bool falls(int body) const { return falls_[linalg::at(body)] != 0; }
  const std::vector<char>& falling() const { return falls_; }
  /// Bodies that fall: a part moves them by the velocities of its end, half of what their weight
  /// adds too far. Not in islands that anything has pressed by more than rounding does.
  void fall(const Eigen::Vector3d& gravity, double dt, const StepContacts& contacts,
            BodySet& bodies);
  void turn_round(double dt, BodySet& bodies) const;
  void turn_plain(double dt, BodySet& bodies) const;
  void turn_keeping_momentum(double dt, BodySet& bodies);
  /// To world axes, after orientations were set from outside.
  void turn_inertias(BodySet& bodies) const;

  /// Spins of the bodies that keep their momentum, in the order of free_long().
  std::vector<StepperMemory::Spin>& spins() { return spins_; }
  const std::vector<StepperMemory::Spin>& spins() const { return spins_; }
  const std::vector<int>& free_long() const { return free_long_; }

 private:
  std::vector<int> moving_, long_;
  std::vector<int> free_, free_round_, free_long_;  // those that no joint moves
  std::vector<StepperMemory::Spin> spins_;
  std::vector<char> may_fall_, falls_;  // bodies
  std::vector<Eigen::Vector3d> weight_only_;
  MovingIslands islands_;
  std::vector<char> pressed_;  // islands, by their root
};

}  // namespace tether::contact::detail
