// Tether: a surface of triangles. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

constexpr double kNoArea = 1e-14;  // least ratio of twice the area to the longest edge squared

/// Joins points that are equal to the last bit: the index of each in `different`.
std::vector<int> welded(const std::vector<Eigen::Vector3d>& points,
                        std::vector<Eigen::Vector3d>& different);

/// Triangles whose corners run counterclockwise seen from the side of the bodies. Corners that are
/// equal to the last bit are joined. Triangles without an area touch nothing.
class TriangleMesh {
 public:
  /// An edge is sharp where the surface bends away from the bodies by more than rounding, or ends.
  /// Only a sharp edge can touch a body that none of its triangles touches.
  struct Triangle {
    std::array<int, 3> corner;
    std::array<int, 3> edge;  // from corner k to the next one: its number in the mesh
    std::array<int, 3> apex;  // corner across that edge; -1: none
    std::array<char, 3> sharp_edge, sharp_corner;
    int patch = 0;  // the same for connected triangles of one plane
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
  void mark_corners();

  std::vector<Eigen::Vector3d> points_;
  std::vector<Triangle> triangles_;
  std::vector<std::size_t> start_;  // of each corner in neighbours_
  std::vector<int> neighbours_;     // corners across an edge
};

/// A binary tree of bounding boxes of triangles.
class TriangleTree {
 public:
  explicit TriangleTree(const TriangleMesh& mesh);

  /// Visits the triangles whose bounding boxes meet `box`, in the order of the tree.
  template <class Visit>
  void near(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    // The whole subtree of a node that does not meet the box is skipped.
    for (std::size_t k = 0; k < nodes_.size();) {
      const Node& node = nodes_[k];
      const bool meets = node.box.intersects(box);
      if (meets && node.triangle >= 0) visit(node.triangle);
      k = meets ? k + 1 : node.next;
    }
  }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int triangle = -1;     // of a leaf
    std::size_t next = 0;  // the node after the subtree of this one
  };
  void add(std::vector<int>& all, std::size_t begin, std::size_t end,
           const std::vector<Eigen::AlignedBox3d>& boxes);

  std::vector<Node> nodes_;
};

}  // namespace tether::contact::detail
