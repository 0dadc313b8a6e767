// Tether: the coordinate along which a joint leaves its bodies free, or that a motion prescribes.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

#include "joints/joint_type.hpp"
#include "mechanics/bodies.hpp"

namespace tether::scene::joints {

/// Hinge: the angle of the first body against the second about the axis, rad, in (-pi, pi]; slider:
/// the way of the first body along the axis, m; distance: the distance of both points, m.
class Coordinate {
 public:
  /// `bodies`: at t = 0.
  Coordinate(const Joint& joint, const Bodies& bodies);

  JointType::MotionOf what() const { return what_; }
  int first() const { return first_; }  ///< of Bodies
  int second() const { return second_; }
  /// The joint's point, carried by the first body: world axes, m.
  Vector3d place(const Bodies& bodies) const;

  double value(const Bodies& bodies) const;
  double rate(const Bodies& bodies) const;
  /// Its second derivative without accelerations of the bodies.
  double rest(const Bodies& bodies) const;
  /// The unit of force along it, on the first body: what() == angle, the moment u; length, the
  /// force u. World axes.
  Vector3d direction(const Bodies& bodies) const;
  /// Its gradient: loads on both bodies that a unit of force along it makes.
  void gradient(const Bodies& bodies, Wrench<double>& on_first, Wrench<double>& on_second) const;

 private:
  const Frame<double>& A(const Bodies& bodies) const { return bodies.frames[at(first_)]; }
  const Frame<double>& B(const Bodies& bodies) const { return bodies.frames[at(second_)]; }

  JointType::MotionOf what_;
  bool fixed_direction_;  // in the axes of the second body
  int first_, second_;
  Vector3d at_first_, at_second_;     // in the axes of each body
  Vector3d of_first_, zero_, ahead_;  // angle: it turns of_first from zero to ahead
  Vector3d axis_;                     // of the second body
};

}  // namespace tether::scene::joints
