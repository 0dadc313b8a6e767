// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// Whether two shapes can touch each other.
bool has_collision(ShapeKind a, ShapeKind b);

/// Adds all points with a gap below `margin`, of shapes that are no mesh and do not
/// meet_as_polyhedra(); normals point from b to a.
void collide(const Shape& a, const Pose& pose_a, const Shape& b, const Pose& pose_b, double margin,
             NearPoints& out);

/// Exchanges the shapes of all points from this one on.
void turn(NearPoints& out, int from);

/// Throws std::invalid_argument unless the shape has the sizes that its kind needs.
void check(const Shape& shape);

}  // namespace tether::contact::detail
