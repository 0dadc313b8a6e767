// Tether: seams between the convex parts of a body (detection, section 5). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "stepping/detection/polyhedra/polyhedron.hpp"

namespace tether::contact::detail {

/// Takes from the open pieces of each part of a body what other parts lie against, and marks the
/// edges beyond which these go on in the plane. Returns for each part those that touch its faces.
std::vector<std::vector<int>> find_seams(std::vector<Polyhedron>& parts,
                                         const std::vector<Pose>& poses);

/// Whether b has the point x, and reaches above the plane through it across n.
bool rises_above(const Polyhedron& b, const Pose& pose, const Eigen::Vector3d& x,
                 const Eigen::Vector3d& n);

/// Whether x lies on an open piece of a face of `a` whose normal is n, up to an angle in radian.
bool is_on_open_piece(const Polyhedron& a, const Pose& pose, const Eigen::Vector3d& x,
                      const Eigen::Vector3d& n, double angle);

/// x, or where it is outside of `a` a point of `a` near to it.
Eigen::Vector3d into(const Polyhedron& a, const Pose& pose, const Eigen::Vector3d& x);

}  // namespace tether::contact::detail
