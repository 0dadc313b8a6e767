// Tether: the coordinate along which a joint leaves its bodies free, or that a motion prescribes.
// SPDX-License-Identifier: BSD-3-Clause
#include "coordinate.hpp"

#include <cmath>

#include "joints/list.hpp"

namespace tether::scene::joints {

Coordinate::Coordinate(const Joint& joint, const Bodies& bodies)
    : what_(type(joint.kind).motion()),
      fixed_direction_(joint.kind != JointKind::distance),
      first_(bodies.index(joint.first)),
      second_(bodies.index(joint.second)),
      at_first_(point_in(A(bodies), joint.at)),
      at_second_(point_in(B(bodies), type(joint.kind).point_on_second(joint))) {
  const Vector3d z = joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d::UnitZ();
  const Vector3d x = z.unitOrthogonal(), y = z.cross(x);
  of_first_ = direction_in(A(bodies), x);
  zero_ = direction_in(B(bodies), x);
  ahead_ = direction_in(B(bodies), y);
  axis_ = direction_in(B(bodies), z);
}

Vector3d Coordinate::place(const Bodies& bodies) const { return point<0>(A(bodies), at_first_).x; }

double Coordinate::value(const Bodies& bodies) const {
  if (what_ == JointType::MotionOf::angle) {
    const Vector3d u = A(bodies).R * of_first_;
    return std::atan2(u.dot(B(bodies).R * ahead_), u.dot(B(bodies).R * zero_));
  }
  const Vector3d d = place(bodies) - point<0>(B(bodies), at_second_).x;
  return fixed_direction_ ? d.dot(B(bodies).R * axis_) : d.norm();
}

double Coordinate::rate(const Bodies& bodies) const {
  Wrench<double> on_first, on_second;
  gradient(bodies, on_first, on_second);
  return on_first.force.dot(A(bodies).v) + on_first.torque.dot(A(bodies).W) +
         on_second.force.dot(B(bodies).v) + on_second.torque.dot(B(bodies).W);
}

double Coordinate::rest(const Bodies& bodies) const {
  if (what_ == JointType::MotionOf::angle)
    return B(bodies).W.cross(direction(bodies)).dot(A(bodies).W - B(bodies).W);
  const Jet<double> a = point<2>(A(bodies), at_first_), b = point<2>(B(bodies), at_second_);
  const Vector3d d = a.x - b.x, d1 = a.x1 - b.x1, d2 = a.x2 - b.x2;
  if (fixed_direction_) {
    const Jet<double> u = mechanics::direction<2>(B(bodies), axis_);
    return d2.dot(u.x) + 2 * d1.dot(u.x1) + d.dot(u.x2);
  }
  const double length = d.norm(), along = d.dot(d1) / length;
  return (d1.squaredNorm() - along * along + d.dot(d2)) / length;
}

Vector3d Coordinate::direction(const Bodies& bodies) const {
  if (fixed_direction_) return B(bodies).R * axis_;
  return (place(bodies) - point<0>(B(bodies), at_second_).x).stableNormalized();
}

void Coordinate::gradient(const Bodies& bodies, Wrench<double>& on_first,
                          Wrench<double>& on_second) const {
  const Vector3d u = direction(bodies);
  on_first = on_second = no_wrench<double>();
  if (what_ == JointType::MotionOf::angle) {
    on_first.torque = u;
    on_second.torque = -u;
    return;
  }
  // A slider's acts on both bodies at the point of the first.
  const Vector3d p = place(bodies);
  on_first.add(A(bodies), p, u);
  on_second.add(B(bodies), fixed_direction_ ? p : point<0>(B(bodies), at_second_).x, Vector3d(-u));
}

}  // namespace tether::scene::joints
