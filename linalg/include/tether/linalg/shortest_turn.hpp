// Tether: the rotation that turns one direction into another. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace tether::linalg {

/// The shortest rotation that takes the direction of `from` to that of `to`; neither is zero. Of
/// opposite ones it is half a turn, of UnitZ about UnitX. Eigen's FromTwoVectors is up to 1e-4 off
/// where they are nearly opposite, and compiles a singular value decomposition in each source that
/// calls it.
inline Eigen::Quaterniond shortest_turn(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = b.dot(a);
  const Eigen::Vector3d across = a.cross(b);
  if (cosine < -0.5) {  // where 1 + cosine loses digits: half a turn, and back from there
    Eigen::Vector3d axis = across;
    if (across.squaredNorm() < 1e-28)
      axis = a.cross(Eigen::Vector3d::Unit(std::abs(a.y()) < 0.9 ? 1 : 0));
    axis = (axis - axis.dot(a) * a).normalized();
    return shortest_turn(-a, b) * Eigen::Quaterniond(0, axis.x(), axis.y(), axis.z());
  }
  const double root = std::sqrt((1 + cosine) * 2), scale = 1 / root;
  return {root * 0.5, across.x() * scale, across.y() * scale, across.z() * scale};
}

}  // namespace tether::linalg
