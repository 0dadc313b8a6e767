// Tether: what both formats of robots say alike. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <tether/scene/scene.hpp>

namespace tether::scene::import {

/// Fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll), rad.
Eigen::Quaterniond from_rpy(const Eigen::Vector3d& rpy);

Eigen::Isometry3d placed(const Eigen::Quaterniond& orientation, const Eigen::Vector3d& position);

/// Shapes must have no larger or smaller numbers: m.
constexpr double kLargestLength = 1e9;

/// The nearest inertia that a body may have: negative and vanishing moments become small ones, then
/// the smaller two of the moments grow alike until they carry the largest.
Eigen::Matrix3d mended_inertia(const Eigen::Matrix3d& inertia);

/// Adds a part to a sum of parts: masses, their common centre, inertias about it.
void add_mass(double mass, const Eigen::Vector3d& centre, const Eigen::Matrix3d& inertia,
              double& total, Eigen::Vector3d& common, Eigen::Matrix3d& sum);

}  // namespace tether::scene::import
