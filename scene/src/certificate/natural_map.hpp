// Tether: how far an impulse is off Coulomb's law. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace tether::scene::certificate {

/// Coefficients of a contact along `axis` and across it; the axis is of no length where they are
/// equal.
struct Friction {
  double along = 0, across = 0;
  double holds = 0;  ///< that along of one that does not slip, where it is larger
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  bool associated = false;  ///< maximum dissipation instead of Coulomb's law
};

/// |y - P(y - w)|, m/s, with P the projection onto the cone |y_t / mu| <= y_n: 0 exactly where
/// impulse and velocity obey the law together (De Saxce and Feng 1998). `y`: impulse over the
/// reduced mass of both bodies; `w`: velocity, its normal part with the bias; n: unit.
inline double natural_residual(const Friction& friction, const Eigen::Vector3d& n,
                               const Eigen::Vector3d& y, const Eigen::Vector3d& w) {
  Eigen::Vector3d t = friction.axis - n.dot(friction.axis) * n;
  if (!(t.squaredNorm() > 0)) t = n.unitOrthogonal();
  t.normalize();
  const Eigen::Vector3d b = n.cross(t);
  const double m1 = friction.along, m2 = friction.across;
  // Tangents scaled by the coefficients: the cone is that of coefficient 1.
  const Eigen::Vector3d x(n.dot(y), m1 > 0 ? t.dot(y) / m1 : 0, m2 > 0 ? b.dot(y) / m2 : 0);
  Eigen::Vector3d v(n.dot(w), m1 * t.dot(w), m2 * b.dot(w));
  if (!friction.associated) v[0] += v.tail<2>().norm();
  const Eigen::Vector3d z = x - v;
  const double size = z.tail<2>().norm();
  Eigen::Vector3d p = z;
  if (size > z[0]) {
    const double onto = std::max(0.0, 0.5 * (z[0] + size));
    p[0] = onto;
    p.tail<2>() *= size > 0 ? onto / size : 0.0;
  }
  const double off = m1 > 0 || m2 > 0 ? 0 : (y - n.dot(y) * n).norm();
  const double slides = std::max((x - p).norm(), off);
  if (!(friction.holds > m1)) return slides;
  const Friction held{friction.holds, m1 > 0 ? m2 * friction.holds / m1 : 0, 0, friction.axis,
                      friction.associated};
  return std::min(slides, std::max(natural_residual(held, n, y, w), (w - n.dot(w) * n).norm()));
}

}  // namespace tether::scene::certificate
