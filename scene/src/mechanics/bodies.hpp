// Tether: bodies as forces and joints see them, in either engine. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

#include "frames.hpp"

namespace tether::scene::mechanics {

/// `slot`: index among the moving bodies, -1: it does not move.
struct Inertia {
  int slot = -1;
  double mass = 0;                                                  ///< kg
  Matrix3d inertia = Matrix3d::Zero(), inverse = Matrix3d::Zero();  ///< body axes, kg m^2
};

/// All bodies of a scene, then the world.
struct Bodies {
  std::vector<Inertia> inertia;
  std::vector<Frame<double>> frames;
  std::vector<Vector3d> w;                         ///< angular velocities in body axes
  std::vector<Eigen::Matrix<double, 3, 4>> turns;  ///< of the moving bodies: turn_of_quaternion
  int moving = 0;
  double time = 0, span = 0;  ///< s; forces are means from `time` on over `span`, 0: of that time
  double since = -1;          ///< when the motion began anew: forces that jump then have jumped

  int world() const { return static_cast<int>(inertia.size()) - 1; }
  bool moves(int body) const { return inertia[at(body)].slot >= 0; }
  /// Index of a body of the scene, where -1 is the world.
  int index(int body) const { return body < 0 ? world() : body; }
};

/// Point `p` and direction `u` of world axes in the axes of a body.
inline Vector3d point_in(const Frame<double>& f, const Vector3d& p) {
  return f.R.transpose() * (p - f.x);
}
inline Vector3d direction_in(const Frame<double>& f, const Vector3d& u) {
  return f.R.transpose() * u;
}

/// Sum of the forces on a body: force in world axes (N), torque about the centre in body axes and,
/// apart from it, torque in world axes (N m).
struct Load6 {
  Vector3d force, torque_body, torque_world;
};

/// Frames of all bodies and, last, of the world: positions and attitudes of the scene, at rest; no
/// inertia, and nothing moves yet.
Bodies placed_bodies(const Scene& scene);

}  // namespace tether::scene::mechanics
