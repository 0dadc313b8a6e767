// Tether: rotation of one rigid body over one step (method, eq. 29). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <tether/contact/stepping.hpp>

namespace tether::contact::detail {

bool is_isotropic(const Eigen::Matrix3d& inertia);

/// R I R' of a body tensor.
Eigen::Matrix3d turned(const Eigen::Matrix3d& tensor, const linalg::Quaternion& q);

/// Angular momentum in world axes.
Eigen::Vector3d spin(const Eigen::Matrix3d& inertia, const linalg::Quaternion& q,
                     const Eigen::Vector3d& w);

/// Unit quaternion of the rotation vector.
linalg::Quaternion exponential(const Eigen::Vector3d& rotation);

/// Turns a body, and its angular velocity with it: so its energy stays.
void turn_with_velocity(const Eigen::Vector3d& rotation, linalg::Quaternion& q, Eigen::Vector3d& w);

/// Change of the angular velocity (world axes) by the gyroscopic term over dt.
Eigen::Vector3d gyroscopic_explicit(const Eigen::Matrix3d& inertia,
                                    const Eigen::Matrix3d& inverse_inertia,
                                    const linalg::Quaternion& q, const Eigen::Vector3d& w,
                                    double dt);
Eigen::Vector3d gyroscopic_implicit(const Eigen::Matrix3d& inertia, const linalg::Quaternion& q,
                                    const Eigen::Vector3d& w, double dt);

/// Turns the body by dt with its angular momentum kept: with body angular velocities W before and
/// W1 after, q1 = q exp(dt (W + W1) / 2) and I W1 = R1' R I W. Then R1'L - R'L is a rotation about
/// W + W1, so (W1 - W).I (W1 + W) = 0: the energy is kept, too, whatever dt.
void turn_with_momentum(const Eigen::Matrix3d& inertia, const Eigen::Matrix3d& inverse_inertia,
                        double dt, linalg::Quaternion& q, Eigen::Vector3d& w,
                        StepperMemory::Spin& kept);
/// By dt, with its angular momentum kept or its angular velocity. Inline: who never turns a body
/// that is not round links nothing of the former.
inline void turn_freely(const Eigen::Matrix3d& inertia, const Eigen::Matrix3d& inverse_inertia,
                        bool keeps_momentum, double dt, linalg::Quaternion& q, Eigen::Vector3d& w) {
  if (w.isZero(0)) return;
  if (!keeps_momentum) {
    q = (exponential(dt * w) * q).normalized();
    return;
  }
  StepperMemory::Spin spin;
  turn_with_momentum(inertia, inverse_inertia, dt, q, w, spin);
}

}  // namespace tether::contact::detail
