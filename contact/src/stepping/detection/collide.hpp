// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/shapes.hpp>

namespace tether::contact::detail {

/// Whether two shapes can touch each other.
bool has_collision(ShapeKind a, ShapeKind b);

/// Adds all points with a gap below `margin`, of shapes that are no mesh and do not
/// meet_as_polyhedra(); normals point from b to a.
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
