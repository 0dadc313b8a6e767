// Tether: meshes of robots. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "robot.hpp"

namespace tether::scene::import {

/// The surface of an .obj or .stl in the folder of the robot's file or below, times `scale`; of
/// `package://name/file` the file. Nothing, with a remark, where it is not there or none.
std::optional<Shape> read_mesh(const std::string& robot, const std::string& name,
                               const Eigen::Vector3d& scale, const std::string& of,
                               Remarks& remarks);

/// Its convex hull; nothing, with a remark, where it is flat.
std::optional<Shape> hull_of(const Shape& mesh, const std::string& of, Remarks& remarks);

/// Its convex parts, or with a remark its hull where it bounds no solid or needs too many.
std::vector<Shape> parts_of(const Shape& mesh, const std::string& of, Remarks& remarks);

}  // namespace tether::scene::import
