// Tether: seams between the convex parts of a body (detection, section 5). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "stepping/detection/polyhedra/polyhedron.hpp"

namespace tether::contact::detail {

/// Surfaces, some of which are boxes and hulls that lie against others of their body.
struct Parts {
  std::vector<Polyhedron> polyhedron;      // of each surface; empty where none is needed
  std::vector<Pose> pose;                  // of each surface
  std::vector<std::vector<int>> touching;  // of each surface, or empty where no surface has any

  /// The surfaces of these numbers, all boxes and hulls of one body and material: takes from their
  /// open pieces what others lie against, and lists those. Poses are those on the body.
  void join(const std::vector<int>& numbers, std::vector<Polyhedron> shapes,
            const std::vector<Pose>& on_body);
  bool has_seams(int surface) const {
    return !touching.empty() && !touching[linalg::at(surface)].empty();
  }
  Seam seam(int surface) const { return has_seams(surface) ? Seam{this, surface} : Seam{}; }
  /// Whether no contact has the point x and the outward normal n, up to an angle in radian: within
  /// the body, or on a surface that goes on above the plane across n.
  bool is_seam(int surface, const Eigen::Vector3d& x, const Eigen::Vector3d& n, double angle) const;
  /// Whether a part beside this one has x on an open face with the normal n.
  bool goes_on(int surface, const Eigen::Vector3d& x, const Eigen::Vector3d& n) const;
};

}  // namespace tether::contact::detail
