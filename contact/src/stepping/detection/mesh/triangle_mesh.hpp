// Tether: a surface of triangles. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace tether::contact::detail {

/// Triangles whose corners are counterclockwise from the side on which bodies are. Corners that
/// are equal to the last bit are one; triangles without an area touch nothing.
class TriangleMesh {
 public:
  /// An edge is sharp where the surface bends away from bodies by more than rounding, and where it
  /// ends: only there an edge touches what no triangle touches.
  struct Triangle {
    std::array<int, 3> corner;
    std::array<int, 3> edge;  // from corner k to the next one: its number in the mesh
    std::array<int, 3> apex;  // corner across that edge; -1: none
    std::array<char, 3> sharp_edge, sharp_corner;
    int patch = 0;  // the same for triangles that go on in one plane
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    bool sharp() const;  // some edge or corner is
  };

  TriangleMesh(const std::vector<Eigen::Vector3d>& points,
               const std::vector<std::array<int, 3>>& triangles);

  int size() const { return static_cast<int>(triangles_.size()); }
  const Triangle& operator[](int t) const { return triangles_[static_cast<std::size_t>(t)]; }
  const Eigen::Vector3d& point(int corner) const {
    return points_[static_cast<std::size_t>(corner)];
  }
  /// Whether the surface stays below the plane across n through the corner, near it.
  bool is_top(int corner, const Eigen::Vector3d& n) const;

 private:
  void add_triangles(const std::vector<Eigen::Vector3d>& points,
                     const std::vector<std::array<int, 3>>& triangles);
  void join_edges();
  void find_patches(const std::vector<std::array<int, 2>>& flat);
  void mark_corners();

  std::vector<Eigen::Vector3d> points_;
  std::vector<Triangle> triangles_;
  std::vector<std::size_t> start_;  // of each corner in neighbours_
  std::vector<int> neighbours_;     // corners across an edge
};

}  // namespace tether::contact::detail
