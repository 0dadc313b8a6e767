// Tether: which triangles are near a box. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/mesh/triangle_tree.hpp"

#include <algorithm>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::contact::detail {

using Eigen::AlignedBox3d;
using linalg::at;

TriangleTree::TriangleTree(const TriangleMesh& mesh) {
  std::vector<AlignedBox3d> boxes(at(mesh.size()));
  for (int t = 0; t < mesh.size(); ++t)
    for (const int corner : mesh[t].corner) boxes[at(t)].extend(mesh.point(corner));
  std::vector<int> all(boxes.size());
  std::iota(all.begin(), all.end(), 0);
  nodes_.reserve(2 * all.size());
  if (!all.empty()) add(all, 0, all.size(), boxes);
}

// Halves the triangles along the longest extent of their centres, so that the tree is balanced.
void TriangleTree::add(std::vector<int>& all, std::size_t begin, std::size_t end,
                       const std::vector<AlignedBox3d>& boxes) {
  const std::size_t own = nodes_.size();
  nodes_.emplace_back();
  AlignedBox3d box, middles;
  for (std::size_t k = begin; k < end; ++k) {
    box.extend(boxes[at(all[k])]);
    middles.extend(boxes[at(all[k])].center());
  }
  nodes_[own].box = box;
  if (end - begin == 1) {
    nodes_[own].triangle = all[begin];
  } else {
    int axis = 0;
    middles.sizes().maxCoeff(&axis);
    const std::size_t half = begin + (end - begin) / 2;
    const auto position = [&](std::size_t k) {
      return all.begin() + static_cast<std::ptrdiff_t>(k);
    };
    std::nth_element(position(begin), position(half), position(end), [&](int a, int b) {
      const double x = boxes[at(a)].center()[axis], y = boxes[at(b)].center()[axis];
      return std::make_pair(x, a) < std::make_pair(y, b);
    });
    add(all, begin, half, boxes);
    add(all, half, end, boxes);
  }
  nodes_[own].next = nodes_.size();
}

}  // namespace tether::contact::detail
