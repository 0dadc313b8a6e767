// Tether: laws along the free coordinates of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <tether/scene/engine.hpp>
#include <vector>

#include "coordinate.hpp"

namespace tether::scene::joints {

/// Limits, motors and friction of all joints of a scene: as the contact library's steps take them,
/// and one by one.
class JointLaws {
 public:
  /// `bodies`: at t = 0. Throws std::invalid_argument on laws of joints that have no free
  /// coordinate, and on a start beyond a limit.
  JointLaws(const Scene& scene, const Bodies& bodies);

  bool any() const { return !joints_.empty(); }
  /// In the order of add(), after which these can be asked for.
  int count() const { return static_cast<int>(signs_.size()); }
  double sign(int law) const { return signs_[at(law)]; }  ///< -1: it sees the coordinate backwards
  int joint(int law) const { return item(law).joint; }    ///< of the scene
  const Coordinate& coordinate(int law) const { return item(law).coordinate; }
  double value(int law, const Bodies& bodies) const { return value(item(law), bodies); }
  void add(const Bodies& bodies, contact::JointLaws& out);
  /// Adds what the impulses (of the last add()) over dt do to their joints.
  void add_forces(const Bodies& bodies, const std::vector<double>& impulses, double dt,
                  std::vector<JointForce>& forces) const;

 private:
  struct Item {
    int joint;
    Joint law;
    Coordinate coordinate;
  };
  double value(const Item& item, const Bodies& bodies) const;
  const Item& item(int law) const { return joints_[at(joint_of_[at(law)])]; }

  std::vector<Item> joints_;
  std::vector<double> signs_;  // of the laws
  std::vector<int> joint_of_;  // place in joints_
};

}  // namespace tether::scene::joints
