// Tether: attitudes as quaternions, wxyz. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include "frames.hpp"

namespace tether::scene::mechanics {

/// R of q / |q|, body to world.
inline Matrix3d rotation(const double* q) {
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

/// q' = q (0, w) / 2, q wxyz, w in body axes.
inline Eigen::Vector4d quaternion_rate(const double* q, const Vector3d& w) {
  return 0.5 * Eigen::Vector4d(-q[1] * w[0] - q[2] * w[1] - q[3] * w[2],
                               q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                               q[0] * w[1] + q[3] * w[0] - q[1] * w[2],
                               q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
}

/// Its derivatives: q' = A(w) q = B(q) w.
inline Eigen::Matrix4d rate_by_quaternion(const Vector3d& w) {
  Eigen::Matrix4d A;
  A << 0, -w[0], -w[1], -w[2],  //
      w[0], 0, w[2], -w[1],     //
      w[1], -w[2], 0, w[0],     //
      w[2], w[1], -w[0], 0;
  return 0.5 * A;
}

inline Eigen::Matrix<double, 4, 3> rate_by_spin(const double* q) {
  Eigen::Matrix<double, 4, 3> B;
  B << -q[1], -q[2], -q[3],  //
      q[0], -q[3], q[2],     //
      q[3], q[0], -q[1],     //
      -q[2], q[1], q[0];
  return 0.5 * B;
}

}  // namespace tether::scene::mechanics
