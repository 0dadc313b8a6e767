// Tether: ellipsoids and cylinders against convex shapes (detection, section 3).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/shapes.hpp>

namespace tether::contact::detail {

/// Pairs of which one is an ellipsoid or a cylinder, the other any shape with an inside.
bool is_convex_pair(ShapeKind a, ShapeKind b);

/// Adds all points with a gap below `margin`; normals point from b to a (detection, 3).
void collide_convex(const Shape& a, const Pose& pose_a, const Shape& b, const Pose& pose_b,
                    double margin, NearPoints& out);

/// The lowest point of an ellipsoid; a cylinder by its rims. A point of the plane, and its normal.
void ellipsoid_plane(const Shape& a, const Pose& pose, const Eigen::Vector3d& plane,
                     const Eigen::Vector3d& n, double margin, NearPoints& out);
void cylinder_plane(const Shape& a, const Pose& pose, const Eigen::Vector3d& plane,
                    const Eigen::Vector3d& n, double margin, NearPoints& out);

}  // namespace tether::contact::detail
