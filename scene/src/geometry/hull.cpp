// Tether: convex hulls of a few points. SPDX-License-Identifier: BSD-3-Clause
#include "hull.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

namespace tether::scene {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Index = std::size_t;

// The plane of three points carries a face if all other points are on one side of it.
class Hull {
 public:
  explicit Hull(const std::vector<Vector3d>& points) : p_(points) {
    Vector3d low = p_.front(), high = low;
    for (const Vector3d& p : p_) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    size_ = (high - low).maxCoeff();
  }

  std::vector<std::vector<Index>> faces() {
    if (!(size_ > 0) || !std::isfinite(size_)) return {};
    for (Index i = 0; i < p_.size(); ++i)
      for (Index j = i + 1; j < p_.size(); ++j)
        for (Index k = j + 1; k < p_.size(); ++k) try_plane(i, j, k);
    return std::move(faces_);
  }

 private:
  Vector3d at(Index m, Index origin) const { return (p_[m] - p_[origin]) / size_; }

  void try_plane(Index i, Index j, Index k) {
    constexpr double kFlat = 1e-10;  // of the size
    Vector3d n = at(j, i).cross(at(k, i));
    if (n.norm() <= kFlat) return;
    n.normalize();
    bool above = false, below = false;
    std::vector<Index> in_plane;
    for (Index m = 0; m < p_.size(); ++m) {
      const double height = n.dot(at(m, i));
      above = above || height > kFlat;
      below = below || height < -kFlat;
      if (std::abs(height) <= kFlat) in_plane.push_back(m);
    }
    if (above == below) return;                 // the plane cuts the hull, or holds all of it
    if (above) n = -n;                          // out of the hull
    if (!met_.insert(in_plane).second) return;  // another three of its points came first

    const Vector3d u = at(j, i).normalized(), v = n.cross(u);
    std::vector<Vector2d> flat;
    for (const Index m : in_plane) flat.emplace_back(u.dot(at(m, i)), v.dot(at(m, i)));
    std::vector<Index> face;
    for (const Index corner : hull_corners(flat)) face.push_back(in_plane[corner]);
    faces_.push_back(std::move(face));
  }

  const std::vector<Vector3d>& p_;
  double size_ = 0;
  std::set<std::vector<Index>> met_;  // faces, each by the points in its plane
  std::vector<std::vector<Index>> faces_;
};

}  // namespace

std::vector<std::vector<Index>> hull_faces(const std::vector<Vector3d>& points) {
  if (points.size() < 4 || points.size() > kMostHullPoints) return {};
  return Hull(points).faces();
}

// Andrew's monotone chain: the lower side from left to right, then the upper one back.
std::vector<Index> hull_corners(const std::vector<Vector2d>& q) {
  std::vector<Index> order(q.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    return q[a].x() < q[b].x() || (q[a].x() == q[b].x() && q[a].y() < q[b].y());
  });
  const auto left_turn = [&](Index a, Index b, Index c) {
    const Vector2d d = q[b] - q[a], e = q[c] - q[a];
    return d.x() * e.y() - d.y() * e.x() > 0;
  };
  std::vector<Index> out;
  for (int side = 0; side < 2 && !order.empty(); ++side) {
    const Index start = out.size();
    for (const Index each : order) {
      while (out.size() >= start + 2 && !left_turn(out[out.size() - 2], out.back(), each))
        out.pop_back();
      out.push_back(each);
    }
    out.pop_back();  // the first of the other side
    std::reverse(order.begin(), order.end());
  }
  return out;
}

}  // namespace tether::scene
