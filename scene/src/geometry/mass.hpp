// Tether: volume, centre and inertia of shapes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

namespace tether::scene {

/// Properties of a uniform solid of density 1: mass = volume, m^3; inertia about the centre, m^5.
struct MassProperties {
  double volume = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
};

/// A plane, points and a mesh have none.
MassProperties mass_properties(const Shape& shape);
/// Properties of shapes that do not overlap, in the axes of their body.
MassProperties mass_properties(const std::vector<Shape>& shapes);

/// Whether the principal moments are > 0 and each at most the sum of the others, but for rounding;
/// inside: by so much that rounding on the way to a scene does no harm.
bool is_inertia(const Eigen::Matrix3d& inertia, bool inside = false);

}  // namespace tether::scene
