// Tether: which triangles are near a box. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "stepping/detection/mesh/triangle_mesh.hpp"

namespace tether::contact::detail {

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
