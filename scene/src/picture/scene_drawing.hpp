// Tether: a scene as it would be drawn by hand. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

#include "canvas.hpp"

namespace tether::scene::picture {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Pose {
  Vector3d position;
  Eigen::Quaterniond orientation;
};
/// Poses of the first bodies of a scene.
using Poses = std::vector<Pose>;

/// The point of a body, or of the world (-1), that was there at t = 0.
Vector3d carried(const Scene& scene, const Poses& poses, int body, const Vector3d& point);

/// One of the two ends of a joint: on its first or on its second body.
Vector3d joint_end(const Scene& scene, const Poses& poses, const Joint& joint, bool second);

/// A panel of the picture and the part of the scene that it shows.
class View {
 public:
  /// All that moves is inside, and no more of planes.
  View(const Scene& scene, const std::vector<const Poses*>& motion, const Box& panel);

  Vector2d pixel(const Vector3d& point) const;
  /// Rows are the picture's right and up, and towards the viewer.
  const Matrix3d& eye() const { return eye_; }
  double pixels_per_metre() const { return scale_; }
  /// m: half the edge of a square that stands for a plane.
  double half_plane() const { return half_plane_; }
  const Box& panel() const { return panel_; }

 private:
  Matrix3d eye_;
  Box panel_;
  Vector2d middle_;
  double scale_ = 1, half_plane_ = 1;
};

/// The scene at the end of a motion, with outlines and paths of the way there: ground hatched,
/// joints, rods, springs, names, a scale. `motion`: at least one; times in s.
void draw_scene(Canvas& canvas, const Scene& scene, const std::vector<const Poses*>& motion,
                double end, const Box& panel);

}  // namespace tether::scene::picture
