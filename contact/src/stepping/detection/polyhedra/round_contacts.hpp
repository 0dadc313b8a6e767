// Tether: balls, capsules and points on polyhedra. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/detection/polyhedra/separating_axes.hpp"

namespace tether::contact::detail {

// A ball, or a capsule with its axis from middle - half to middle + half.
struct Round {
  Eigen::Vector3d middle, half;
  double radius;
  bool capsule;
};

constexpr int kCapsuleOnEdge = 2;  // first feature of these points

// Adds contacts of a ball, or of both ends of a capsule and of the points at which its axis passes
// an edge between them.
void round_on_polyhedron(const Round& round, const Placed& polyhedron, double margin,
                         NearPoints& out);

/// Adds contacts of single points; `pose` has the same origin as the polyhedron.
void points_on_polyhedron(const std::vector<Eigen::Vector3d>& points, const Pose& pose,
                          const Placed& polyhedron, double margin, NearPoints& out);

}  // namespace tether::contact::detail
