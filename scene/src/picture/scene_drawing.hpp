// Tether: a scene as it would be drawn by hand. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

#include "canvas.hpp"

namespace tether::scene::picture {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Poses of the first bodies of a scene.
using Poses = std::vector<Pose>;

/// The scene at the end of a motion, with outlines and paths of the way there: ground hatched,
/// joints, rods, springs, names, a scale. `motion`: at least one; times in s.
void draw_scene(Canvas& canvas, const Scene& scene, const std::vector<const Poses*>& motion,
                double end, const Box& panel);

}  // namespace tether::scene::picture
