// Tether: the closed surface of a solid. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/mesh/closed_surface.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <tether/linalg/pi.hpp>

#include "problem/refuse.hpp"
#include "stepping/detection/mesh/triangle_mesh.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr std::size_t kMostTriangles = 20000;

std::string listed(const std::array<int, 3>& t) {
  return "[" + std::to_string(t[0]) + ", " + std::to_string(t[1]) + ", " + std::to_string(t[2]) +
         "]";
}

}  // namespace

void refuse_mesh(const std::string& what) { throw std::invalid_argument("mesh: " + what); }

ClosedSurface::ClosedSurface(const Shape& mesh) : triangles_(mesh.triangles) {
  if (triangles_.size() > kMostTriangles)
    refuse_mesh("has " + std::to_string(triangles_.size()) +
                " triangles; on a body that moves at most " + std::to_string(kMostTriangles) +
                " are split into convex parts");
  set_points(mesh.points);
  join_edges();
  if (!(volume_ > 0))
    refuse("mesh: volume within the triangles", volume_ * std::pow(unit_, 3),
           "must be > 0 m^3: they run counterclockwise seen from outside; exchange two "
           "corners of each");
}

bool ClosedSurface::contains(const Vector3d& p) const {
  double angle = 0;
  for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
    if (is_over(t, p, -kInPlane) && std::abs(normal_[at(t)].dot(p - corner(t, 0))) <= kInPlane)
      return false;
    const Vector3d a = corner(t, 0) - p, b = corner(t, 1) - p, c = corner(t, 2) - p;
    const double x = a.norm(), y = b.norm(), z = c.norm();
    angle += std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
  }
  return angle > linalg::kPi;  // half of 4 pi, in halves
}

void ClosedSurface::demand_no_crossing() const {
  const int n = static_cast<int>(triangles_.size());
  std::vector<Eigen::AlignedBox3d> box(at(n));
  std::vector<int> order(at(n));
  for (int t = 0; t < n; ++t) {
    order[at(t)] = t;
    for (int k = 0; k < 3; ++k) box[at(t)].extend(corner(t, k));
  }
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return box[at(a)].min().x() < box[at(b)].min().x(); });
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t k = i + 1; k < order.size(); ++k) {
      const auto &a = box[at(order[i])], &b = box[at(order[k])];
      if (b.min().x() > a.max().x()) break;
      if (!a.intersects(b)) continue;
      if (passes(order[i], order[k]) || passes(order[k], order[i]))
        refuse_mesh("triangles " + std::to_string(std::min(order[i], order[k])) + " and " +
                    std::to_string(std::max(order[i], order[k])) +
                    " pass through each other; a surface that bounds a solid does not");
    }
}

void ClosedSurface::set_points(const std::vector<Vector3d>& points) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : points) box.extend(p);
  // A power of two scales without rounding.
  unit_ = std::exp2(std::ceil(std::log2(box.sizes().maxCoeff())));
  middle_ = (box.min() / unit_ + box.max() / unit_) / 2;
  number_ = welded(points, points_);
  for (Vector3d& p : points_) p /= unit_;
}

void ClosedSurface::join_edges() {
  std::map<std::pair<int, int>, int> left;  // triangle on the left of a directed edge
  const int n = static_cast<int>(triangles_.size());
  for (int t = 0; t < n; ++t) {
    const Vector3d u = corner(t, 1) - corner(t, 0), v = corner(t, 2) - corner(t, 0);
    const double longest2 = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
    if (!(u.cross(v).norm() > kNoArea * longest2))
      refuse_mesh("triangle " + std::to_string(t) + ", " + listed(triangles_[at(t)]) +
                  ", has no area: leave it out and join the points of its neighbours");
    normal_.push_back(u.cross(v).normalized());
    area_.push_back(u.cross(v).norm());
    volume_ += corner(t, 0).dot(corner(t, 1).cross(corner(t, 2))) / 6;
    for (int k = 0; k < 3; ++k) {
      const auto [known, fresh] = left.emplace(ends(t, k), t);
      if (!fresh)
        refuse_mesh(
            "triangles " + std::to_string(known->second) + " and " + std::to_string(t) +
            " pass the edge " + edge(t, k) +
            " in the same direction: turn one of them, or part the points where surfaces touch");
    }
  }
  linalg::DisjointSets flat(n);
  for (int t = 0; t < n; ++t)
    for (int k = 0; k < 3; ++k) {
      const auto [from, to] = ends(t, k);
      const auto other = left.find({to, from});
      if (other == left.end())
        refuse_mesh(
            "the edge " + edge(t, k) + " of triangle " + std::to_string(t) +
            " belongs to no other triangle: the surface of a body that moves must be closed");
      if ((normal_[at(t)] - normal_[at(other->second)]).norm() < kUpright)
        flat.join(t, other->second);
    }
  set_planes(flat);
  for (const auto& [pair, t] : left) {
    const int other = left.at({pair.second, pair.first});
    const int p = plane_[at(t)], q = plane_[at(other)];
    if (pair.first > pair.second || p == q) continue;
    // The third corner of the other triangle is in front of this one.
    double rise = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) rise = std::max(rise, plane(p).height(corner(other, k)));
    if (rise > kInPlane)
      hollows_.push_back({points_[at(pair.first)], points_[at(pair.second)], {p, q}});
  }
}

// Flat parts have the plane of their largest triangle.
void ClosedSurface::set_planes(linalg::DisjointSets& flat) {
  const int n = static_cast<int>(triangles_.size());
  std::vector<int> largest(at(n), -1);
  for (int t = 0; t < n; ++t) {
    int& best = largest[at(flat.root(t))];
    if (best < 0 || area_[at(t)] > area_[at(best)]) best = t;
  }
  plane_.resize(at(n));
  for (int t = 0; t < n; ++t) {
    const int best = largest[at(flat.root(t))];
    if (flat.root(t) == t) {
      plane_[at(t)] = static_cast<int>(planes_.size());
      const Vector3d& m = normal_[at(best)];
      planes_.push_back({m, m.dot(corner(best, 0))});
    } else {
      plane_[at(t)] = plane_[at(flat.root(t))];
    }
  }
}

std::pair<int, int> ClosedSurface::ends(int t, int k) const {
  return {number_[at(triangles_[at(t)][at(k)])], number_[at(triangles_[at(t)][at((k + 1) % 3)])]};
}

std::string ClosedSurface::edge(int t, int k) const {
  return "[" + std::to_string(triangles_[at(t)][at(k)]) + ", " +
         std::to_string(triangles_[at(t)][at((k + 1) % 3)]) + "]";
}

// Whether an edge of triangle s passes through the inside of triangle t.
bool ClosedSurface::passes(int s, int t) const {
  const Vector3d& n = normal_[at(t)];
  for (int k = 0; k < 3; ++k) {
    const Vector3d &p = corner(s, k), &q = corner(s, (k + 1) % 3);
    const double d = n.dot(p - corner(t, 0)), e = n.dot(q - corner(t, 0));
    if (!(std::min(d, e) < -kInPlane && std::max(d, e) > kInPlane)) continue;
    if (is_over(t, p + d / (d - e) * (q - p), kInPlane)) return true;
  }
  return false;
}

// Whether the foot of x in the plane of a triangle is in it, so far from its edges.
bool ClosedSurface::is_over(int t, const Vector3d& x, double within) const {
  for (int k = 0; k < 3; ++k) {
    const Vector3d along = (corner(t, (k + 1) % 3) - corner(t, k)).normalized();
    if (!(normal_[at(t)].cross(along).dot(x - corner(t, k)) > within)) return false;
  }
  return true;
}

}  // namespace tether::contact::detail
