// Tether: laws along the free coordinates of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

#include "coordinate.hpp"

namespace tether::scene::joints {

/// The coordinates along which laws and springs of a joint act, three of a ball. Throws
/// std::invalid_argument where there are none.
std::vector<Coordinate> coordinates_of(const Joint& joint, std::size_t number,
                                       const Bodies& bodies);

/// Limits, motors, friction and springs of all joints of a scene: as the contact library's steps
/// take them, and one by one.
class JointLaws {
 public:
  /// `bodies`: at t = 0. Throws std::invalid_argument on laws of joints that have no free
  /// coordinate, and on a start beyond a limit.
  JointLaws(const Scene& scene, const Bodies& bodies);

  bool any() const { return !joints_.empty(); }
  /// In the order of add(), after which these can be asked for.
  int count() const { return static_cast<int>(placed_.size()); }
  double sign(int law) const { return placed_[at(law)].sign; }  ///< -1: sees it backwards
  int joint(int law) const { return item(law).joint; }          ///< of the scene
  const Coordinate& coordinate(int law) const { return item(law).coordinate; }
  double value(int law, const Bodies& bodies) const { return value(item(law), bodies); }
  void add(const Bodies& bodies, contact::JointLaws& out);
  /// Adds what the impulses (of the last add()) over dt do to their joints; springs are Forces and
  /// tell theirs.
  void add_forces(const Bodies& bodies, const std::vector<double>& impulses, double dt,
                  std::vector<JointForce>& forces) const;

 private:
  struct Item {
    int joint;
    Joint law;
    Coordinate coordinate;
  };
  struct Placed {
    int item;
    double sign;
    bool sprung;
  };
  double value(const Item& item, const Bodies& bodies) const;
  const Item& item(int law) const { return joints_[at(placed_[at(law)].item)]; }

  std::vector<Item> joints_;    // a ball is three
  std::vector<Placed> placed_;  // by law
};

}  // namespace tether::scene::joints
