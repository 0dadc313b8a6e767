// Tether: the direction in which two convex shapes lie farthest apart (detection, section 1).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/detection/convex_shape.hpp"

namespace tether::contact::detail {

/// Unit normal from b to a, and the points of both that are nearest to each other along it.
struct Separation {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ(), on_first = Eigen::Vector3d::Zero(),
                  on_second = Eigen::Vector3d::Zero();
  double gap = 0;
};

/// s(n) = min over a of n.x - max over b of n.y: the gap along n.
double separation(const ConvexShape& a, const ConvexShape& b, const Eigen::Vector3d& n);

/// Finds the direction of the largest separation (detection, section 3). Returns false if the gap
/// is at least `margin`.
bool find_separation(const ConvexShape& a, const ConvexShape& b, double margin, Separation& out);

}  // namespace tether::contact::detail
