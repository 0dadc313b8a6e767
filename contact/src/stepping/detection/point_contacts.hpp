// Tether: where a point is nearest to a shape (detection, section 5). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/shapes.hpp>

namespace tether::contact::detail {

/// Nearest point of the surface of a shape to a point, in the axes of the shape.
struct Nearest {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, out of the shape
  double gap = 0;                                     ///< along it to the given point; < 0: inside
};

/// Sphere, capsule, box, ellipsoid, cylinder; exact outside and inside. detection, 5.
Nearest nearest_on(const Shape& shape, const Eigen::Vector3d& p);

/// Touching points, each by itself, against another shape; normals point to the points.
void collide_points(const Shape& points, const Pose& pose, const Shape& shape,
                    const Pose& shape_pose, double margin, NearPoints& out);

}  // namespace tether::contact::detail
