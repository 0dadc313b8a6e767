// Tether: from where a scene is seen, and how large. SPDX-License-Identifier: BSD-3-Clause
#include "view.hpp"

#include "geometry/shape_type.hpp"
#include "joints/joint_type.hpp"

namespace tether::scene::picture {

namespace {

/// A motion in a plane y = const is seen from the front, as it would be drawn by hand.
bool in_plane(const Scene& scene, const std::vector<const Poses*>& motion) {
  double size = 0, depth = 0;
  for (const Poses* now : motion)
    for (std::size_t b = 0; b < now->size(); ++b) {
      if (scene.bodies[b].fixed) continue;
      const Pose &pose = (*now)[b], &first = (*motion.front())[b];
      const Vector3d moved = pose.position - first.position;
      size = std::max(size, moved.norm());
      depth = std::max(depth, std::abs(moved.y()));
      const Eigen::Quaterniond turn = pose.orientation * first.orientation.conjugate();
      if (std::hypot(turn.x(), turn.z()) > 1e-3) return false;
    }
  return depth <= 1e-6 * size + 1e-12;
}

Matrix3d eye_of(const Scene& scene, const std::vector<const Poses*>& motion) {
  Matrix3d eye;
  if (in_plane(scene, motion)) {
    eye << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    return eye;
  }
  const double azimuth = 0.45, elevation = 0.3;  // rad
  eye.row(0) << std::cos(azimuth), std::sin(azimuth), 0;
  eye.row(2) << std::sin(azimuth) * std::cos(elevation), -std::cos(azimuth) * std::cos(elevation),
      std::sin(elevation);
  eye.row(1) = Vector3d(eye.row(2)).cross(Vector3d(eye.row(0)));
  return eye;
}

}  // namespace

Vector3d carried(const Scene& scene, const Poses& poses, int body, const Vector3d& point) {
  const auto b = static_cast<std::size_t>(body);
  if (body < 0 || b >= poses.size()) return point;
  const Body& start = scene.bodies[b];
  return poses[b].position +
         poses[b].orientation * (start.orientation.conjugate() * (point - start.position));
}

Vector3d joint_end(const Scene& scene, const Poses& poses, const Joint& joint, bool second) {
  return second
             ? carried(scene, poses, joint.second, joints::type(joint.kind).point_on_second(joint))
             : carried(scene, poses, joint.first, joint.at);
}

View::View(const Scene& scene, const std::vector<const Poses*>& motion, const Box& panel)
    : eye_(eye_of(scene, motion)), panel_(panel) {
  constexpr double kBig = std::numeric_limits<double>::max();
  Vector2d low(kBig, kBig), high = -low;
  const auto take = [&](const Vector3d& p, double around) {
    if (!p.allFinite()) return;
    const Vector2d q = (eye_ * p).head<2>();
    low = low.cwiseMin(q - Vector2d::Constant(around));
    high = high.cwiseMax(q + Vector2d::Constant(around));
  };
  for (std::size_t b = 0; b < motion.front()->size(); ++b) {
    const double reach = reach_of(scene.bodies[b]);
    if (std::isinf(reach)) continue;  // a plane
    for (const Poses* now : motion) take((*now)[b].position, reach);
  }
  for (const Joint& joint : scene.joints)
    if (joint.kind != JointKind::slider && joint.kind != JointKind::planar)
      for (const bool second : {false, true})
        if ((second ? joint.second : joint.first) < 0)
          take(joint_end(scene, *motion.front(), joint, second), 0);
  for (const Spring& spring : scene.springs) {
    if (spring.first < 0) take(spring.at, 0);
    if (spring.second < 0) take(spring.at_second, 0);
    if (spring.cable)
      for (const Ring& ring : spring.cable->rings)
        if (ring.body < 0) take(ring.at, 0);
  }
  if (low.x() > high.x()) low = {-1, -1}, high = {1, 1};
  middle_ = (low + high) / 2;
  half_plane_ = std::max((high - low).norm(), 1e-6);
  const Vector2d size = (high - low).cwiseMax(1e-6);
  const double room = 0.86;  // of the panel; names and the scale lie around
  scale_ =
      room * std::min((panel.right - panel.left) / size.x(), (panel.bottom - panel.top) / size.y());
}

}  // namespace tether::scene::picture
