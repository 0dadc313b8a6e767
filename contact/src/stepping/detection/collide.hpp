// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/shapes.hpp>

namespace tether::contact::detail {

/// Pairs of shapes that collide() treats, in either order.
bool has_own_collision(ShapeKind a, ShapeKind b);

/// Adds all points with a gap below `margin`; normals point from b to a.
void collide(const Shape& a, const Pose& pose_a, const Shape& b, const Pose& pose_b, double margin,
             NearPoints& out);

/// Exchanges the shapes of all points from this one on.
void turn(NearPoints& out, int from);

/// The points of shape a, no plane and no mesh, against the plane through a point across n.
void collide_plane(const Shape& a, const Pose& pose_a, const Eigen::Vector3d& on_plane,
                   const Eigen::Vector3d& n, double margin, NearPoints& out);

/// Farthest point of the shape from its origin (infinite for planes).
double reach(const Shape& shape);

/// Throws std::invalid_argument unless the shape has the sizes that its kind needs.
void check(const Shape& shape);

}  // namespace tether::contact::detail
