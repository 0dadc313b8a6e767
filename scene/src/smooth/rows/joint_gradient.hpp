// Tether: the gradient of the rows of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "joints/joint_rows.hpp"
#include "moving_bodies.hpp"

namespace tether::scene::smooth {

using joints::JointRows;

/// G (rows x 6 velocities of each moving body, angular ones in body axes), G M^-1 and G M^-1 G^T.
struct JointGradient {
  Eigen::MatrixXd G, GM, S;

  void form(const JointRows& rows, const MovingBodies& bodies);
};

}  // namespace tether::scene::smooth
