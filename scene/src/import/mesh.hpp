// Tether: meshes of robots. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import {

/// The surface of a file of triangles in the folder of the problems or below, times `scale`. The
/// folder of a package is that of the robot, or one of that name above it. Nothing, with a remark,
/// where it is not there or none.
std::optional<Shape> read_mesh(const Problems& robot, const std::string& name,
                               const Eigen::Vector3d& scale, const std::string& of,
                               Remarks& remarks);

/// Its convex hull, but for points that are hardly above it; nothing, with a remark, where it is
/// flat.
std::optional<Shape> hull_of(const Shape& mesh, const std::string& of, Remarks& remarks);

/// Puts convex parts in the place of meshes, or with a remark the hull of one that bounds no solid
/// or needs too many parts, or `as_hulls` of all.
void make_convex(Model& model, bool as_hulls);

}  // namespace tether::scene::import
