// Tether: from where a scene is seen, and how large. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene_drawing.hpp"

namespace tether::scene::picture {

/// The point of a body, or of the world (-1), that was there at t = 0.
Vector3d carried(const Scene& scene, const Poses& poses, int body, const Vector3d& point);

/// One of the two ends of a joint: on its first or on its second body.
Vector3d joint_end(const Scene& scene, const Poses& poses, const Joint& joint, bool second);

/// A panel of the picture and the part of the scene that it shows.
class View {
 public:
  /// All that moves is inside, and no more of planes.
  View(const Scene& scene, const std::vector<const Poses*>& motion, const Box& panel);

  Vector2d pixel(const Vector3d& point) const {
    const Vector2d q = scale_ * ((eye_ * point).head<2>() - middle_);
    return {(panel_.left + panel_.right) / 2 + q.x(), (panel_.top + panel_.bottom) / 2 - q.y()};
  }

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

}  // namespace tether::scene::picture
