// Tether: the coordinate along which a joint leaves its bodies free, or that a motion prescribes.
// SPDX-License-Identifier: BSD-3-Clause
#include "coordinate.hpp"

#include "joints/list.hpp"

namespace tether::scene::joints {

Coordinate::Coordinate(const Joint& joint, const Bodies& bodies, int component)
    : what_(component < 0 ? type(joint.kind).motion() : MotionOf::angle),
      fixed_direction_(joint.kind != JointKind::distance),
      component_(component),
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
  start_ = A(bodies).R.transpose() * B(bodies).R;
}

Vector3d Coordinate::place(const Bodies& bodies) const { return point<0>(A(bodies), at_first_).x; }

double Coordinate::rest(const Bodies& bodies) const {
  if (what_ == MotionOf::angle)
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

}  // namespace tether::scene::joints
