// Tether: a surface of triangles. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/mesh/triangle_mesh.hpp"

#include <algorithm>
#include <numeric>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>
#include <tuple>
#include <utility>

namespace tether::contact::detail {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using linalg::at;

namespace {

struct HalfEdge {
  int low, high;  // corners
  int triangle, side;
};

}  // namespace

std::vector<int> welded(const std::vector<Vector3d>& points, std::vector<Vector3d>& different) {
  std::vector<int> order(points.size()), number(points.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int k) {
    const Vector3d& p = points[at(k)];
    return std::make_tuple(p.x(), p.y(), p.z());
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k == 0 || key(order[k - 1]) != key(order[k])) different.push_back(points[at(order[k])]);
    number[at(order[k])] = static_cast<int>(different.size()) - 1;
  }
  return number;
}

bool TriangleMesh::Triangle::sharp() const {
  const auto any = [](const std::array<char, 3>& a) { return a[0] != 0 || a[1] != 0 || a[2] != 0; };
  return any(sharp_edge) || any(sharp_corner);
}

TriangleMesh::TriangleMesh(const std::vector<Vector3d>& points,
                           const std::vector<std::array<int, 3>>& triangles) {
  add_triangles(points, triangles);
  join_edges();
  mark_corners();
}

void TriangleMesh::add_triangles(const std::vector<Vector3d>& points,
                                 const std::vector<std::array<int, 3>>& triangles) {
  const std::vector<int> number = welded(points, points_);
  for (const std::array<int, 3>& each : triangles) {
    Triangle t;
    for (int k = 0; k < 3; ++k) t.corner[at(k)] = number[at(each[at(k)])];
    const Vector3d &a = point(t.corner[0]), &b = point(t.corner[1]), &c = point(t.corner[2]);
    const double longest2 =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const Vector3d area = (b - a).cross(c - a);
    if (!(area.norm() > kNoArea * longest2)) continue;
    t.normal = area.normalized();
    t.apex.fill(-1);
    t.sharp_edge.fill(1);
    t.sharp_corner.fill(0);
    triangles_.push_back(t);
  }
}

void TriangleMesh::join_edges() {
  std::vector<HalfEdge> halves;
  for (int t = 0; t < size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int from = (*this)[t].corner[at(k)], to = (*this)[t].corner[at((k + 1) % 3)];
      halves.push_back({std::min(from, to), std::max(from, to), t, k});
    }
  std::sort(halves.begin(), halves.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.triangle, a.side) <
           std::tie(b.low, b.high, b.triangle, b.side);
  });
  linalg::DisjointSets flat(size());
  int number = 0;
  for (std::size_t first = 0, end = 0; first < halves.size(); first = end, ++number) {
    while (end < halves.size() && halves[end].low == halves[first].low &&
           halves[end].high == halves[first].high)
      triangles_[at(halves[end].triangle)].edge[at(halves[end].side)] = number, ++end;
    // More than two triangles at an edge, or two with opposite orientation, are not joined.
    const HalfEdge &h = halves[first], &o = halves[end - 1];
    Triangle &s = triangles_[at(h.triangle)], &t = triangles_[at(o.triangle)];
    if (end != first + 2 || s.corner[at(h.side)] == t.corner[at(o.side)]) continue;
    s.apex[at(h.side)] = t.corner[at((o.side + 2) % 3)];
    t.apex[at(o.side)] = s.corner[at((h.side + 2) % 3)];
    const Vector3d& from = point(h.low);
    const Vector3d along = (point(h.high) - from).normalized();
    const Vector3d way = point(s.apex[at(h.side)]) - from;
    const double rise = s.normal.dot(way), out = (way - along.dot(way) * along).norm();
    const bool ahead = s.normal.dot(t.normal) > 0;
    if (ahead && std::abs(rise) <= kUpright * out) flat.join(h.triangle, o.triangle);
    const bool bends_away = rise < -kUpright * out || (!ahead && rise <= kUpright * out);
    s.sharp_edge[at(h.side)] = t.sharp_edge[at(o.side)] = bends_away ? 1 : 0;
  }
  for (int t = 0; t < size(); ++t) triangles_[at(t)].patch = flat.root(t);
}

void TriangleMesh::mark_corners() {
  std::vector<char> sharp(points_.size(), 0);
  std::vector<std::array<int, 2>> links;
  for (const Triangle& t : triangles_)
    for (int k = 0; k < 3; ++k) {
      const int a = t.corner[at(k)], b = t.corner[at((k + 1) % 3)];
      links.push_back({a, b});
      links.push_back({b, a});
      if (t.sharp_edge[at(k)] != 0) sharp[at(a)] = sharp[at(b)] = 1;
    }
  std::sort(links.begin(), links.end());
  links.erase(std::unique(links.begin(), links.end()), links.end());
  start_.assign(points_.size() + 1, 0);
  for (const std::array<int, 2>& each : links) ++start_[at(each[0]) + 1];
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  for (const std::array<int, 2>& each : links) neighbours_.push_back(each[1]);
  for (Triangle& t : triangles_)
    for (int k = 0; k < 3; ++k) t.sharp_corner[at(k)] = sharp[at(t.corner[at(k)])];
}

bool TriangleMesh::is_top(int corner, const Vector3d& n) const {
  for (std::size_t k = start_[at(corner)]; k < start_[at(corner) + 1]; ++k) {
    const Vector3d way = point(neighbours_[k]) - point(corner);
    if (n.dot(way) > kInPlane * way.norm()) return false;
  }
  return true;
}

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
