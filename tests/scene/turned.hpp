// A scene seen from other axes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <tether/scene/scene.hpp>

/// Bodies, joints and gravity turned about the origin; no springs or loads.
inline tether::scene::Scene turned(tether::scene::Scene s, const Eigen::Vector3d& axis,
                                   double angle) {
  const tether::linalg::Quaternion by(Eigen::AngleAxisd(angle, axis.normalized()));
  if (s.gravity) *s.gravity = by * *s.gravity;
  for (tether::scene::Body& body : s.bodies) {
    body.position = by * body.position;
    body.orientation = by * body.orientation;
    body.velocity = by * body.velocity;
    body.angular_velocity = by * body.angular_velocity;
  }
  for (tether::scene::Joint& joint : s.joints) {
    joint.at = by * joint.at;
    joint.axis = by * joint.axis;
  }
  return s;
}
