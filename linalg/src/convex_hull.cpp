// Tether: convex hulls of points. SPDX-License-Identifier: BSD-3-Clause
//
// Gift wrapping (Chand and Kapur, An algorithm for convex polytopes, J. ACM 17, 1970) by planes:
// from each edge of a face to the plane that lies farthest about it. A face is the set of points
// near its plane, a corner is a point of three faces or more: so nothing depends on which of
// several points in a plane, or on a line, comes first.
#include <tether/linalg/convex_hull.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

namespace tether::linalg {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Index = std::size_t;
using Faces = std::vector<std::vector<Index>>;

constexpr double kThin = 1e-7;  // of the extent: points of single precision that lie in a plane

class Hull {
 public:
  explicit Hull(const std::vector<Vector3d>& points) : given_(points) {
    Vector3d low = points.front(), high = low;
    for (const Vector3d& p : points) {
      if (!p.allFinite()) return;
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    size_ = (high - low).maxCoeff();
    if (!(size_ > 0) || !std::isfinite(size_)) return;
    for (const Vector3d& p : points) p_.emplace_back((p - low) / size_);
  }

  Faces faces() {
    if (p_.empty()) return {};
    // A plane against the lowest point, turned about it until it meets another point, then about
    // both.
    const Vector3d lowest =
        *std::min_element(p_.begin(), p_.end(), [](const Vector3d& a, const Vector3d& b) {
          return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
        });
    const Vector3d n = farthest(lowest, Vector3d::UnitY(), -Vector3d::UnitX());
    add_face(lowest, n);
    if (faces_.empty()) {
      Vector3d along = Vector3d::Zero();
      for (const Index k : near(lowest, n))
        if ((p_[k] - lowest).norm() > along.norm()) along = p_[k] - lowest;
      if (!(along.norm() > kThin)) return {};
      add_face(lowest, farthest(lowest, along.normalized(), n));
    }
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const Face face = faces_[f];
      for (std::size_t k = 0; k < face.polygon.size(); ++k) {
        const Vector3d a = p_[face.polygon[k]];
        const Vector3d b = p_[face.polygon[(k + 1) % face.polygon.size()]];
        add_face(a, farthest(a, (b - a).normalized(), face.normal));
      }
    }
    return corners_of_faces();
  }

 private:
  struct Face {
    Vector3d normal;
    std::vector<Index> points, polygon;  // near its plane; around them
  };

  std::vector<Index> near(const Vector3d& on_plane, const Vector3d& n) const {
    std::vector<Index> out;
    for (std::size_t k = 0; k < p_.size(); ++k)
      if (std::abs(n.dot(p_[k] - on_plane)) <= kThin) out.push_back(k);
    return out;
  }

  /// The normal of the plane through `a` along `e` that lies farthest, about that line, from the
  /// plane across n, which all points are below. The point farthest from the line decides which of
  /// several in that plane.
  Vector3d farthest(const Vector3d& a, const Vector3d& e, const Vector3d& n) const {
    const Vector3d inward = n.cross(e);
    Vector2d best(1, 0);  // along `inward`, and below
    const auto each = [&](const auto& is_better) {
      const Vector2d so_far = best;
      double most = -1;
      for (const Vector3d& p : p_) {
        const Vector2d d(inward.dot(p - a), std::max(0.0, -n.dot(p - a)));
        const double value = d.norm() > kThin ? is_better(d, so_far) : -1;
        if (!(value > most)) continue;
        most = value;
        best = d;
      }
    };
    each([](const Vector2d& d, const Vector2d&) { return std::atan2(d.y(), d.x()); });
    each([&](const Vector2d& d, const Vector2d& of) {
      const double height = (of.x() * d.y() - of.y() * d.x()) / of.norm();
      return std::abs(height) <= kThin && d.dot(of) > 0 ? d.norm() : -1;
    });
    return (best.x() * inward - best.y() * n).cross(e).normalized();
  }

  Vector2d in_plane(Index k, Index origin, const Vector3d& u, const Vector3d& v) const {
    const Vector3d d = (given_[k] - given_[origin]) / size_;
    return {u.dot(d), v.dot(d)};
  }

  /// The face in a plane that has all points below it, unless it is a line or part of a known one.
  void add_face(const Vector3d& on_plane, const Vector3d& n) {
    std::vector<Index> points = near(on_plane, n);
    if (points.size() == p_.size() || !known_.insert(points).second) return;
    const Vector3d u = n.unitOrthogonal(), v = n.cross(u);
    std::vector<Vector2d> flat;
    for (const Index k : points) flat.push_back(in_plane(k, points.front(), u, v));
    std::vector<Index> polygon = hull_corners(flat);
    Vector2d longest = Vector2d::Zero();
    for (const Index k : polygon) {
      const Vector2d d = flat[k] - flat[polygon.front()];
      if (d.norm() > longest.norm()) longest = d;
    }
    const bool wide = std::any_of(polygon.begin(), polygon.end(), [&](Index k) {
      const Vector2d d = flat[k] - flat[polygon.front()];
      return std::abs(longest.x() * d.y() - longest.y() * d.x()) > kThin * longest.norm();
    });
    if (!wide) return;
    const auto within = [](const std::vector<Index>& a, const std::vector<Index>& b) {
      return std::includes(b.begin(), b.end(), a.begin(), a.end());
    };
    for (Face& f : faces_) {
      if (within(points, f.points)) return;
      if (within(f.points, points)) f = {n, {}, {}};
    }
    for (Index& k : polygon) k = points[k];
    faces_.push_back({n, std::move(points), std::move(polygon)});
  }

  /// Points of three faces or more; of several at one place the first.
  std::vector<char> corners() const {
    std::vector<int> count(p_.size(), 0);
    for (const Face& f : faces_)
      for (const Index k : f.points) ++count[k];
    std::vector<char> out(p_.size(), 0);
    for (std::size_t k = 0; k < count.size(); ++k) out[k] = count[k] > 2;
    for (const Face& f : faces_)
      for (std::size_t i = 0; i < f.points.size(); ++i)
        for (std::size_t j = i + 1; j < f.points.size() && out[f.points[i]]; ++j)
          if ((p_[f.points[i]] - p_[f.points[j]]).norm() <= kThin) out[f.points[j]] = 0;
    return out;
  }

  /// Faces in the order of their first three corners that are on no line, each from the corner that
  /// lies farthest back from the second to the first of these.
  Faces corners_of_faces() const {
    const std::vector<char> is_corner = corners();
    std::vector<std::pair<std::vector<Index>, std::vector<Index>>> ordered;
    for (const Face& f : faces_) {
      std::vector<Index> all;
      for (const Index k : f.points)
        if (is_corner[k]) all.push_back(k);
      if (all.size() < 3) continue;
      const Vector3d u = ((given_[all[1]] - given_[all[0]]) / size_).normalized();
      const Vector3d v = f.normal.cross(u).normalized();
      const auto flat = [&](Index k) { return in_plane(k, all[0], u, v); };
      const auto third = std::find_if(all.begin() + 2, all.end(),
                                      [&](Index k) { return std::abs(flat(k).y()) > kThin; });
      if (third == all.end()) continue;
      std::vector<Index> loop = all;
      Vector2d middle = Vector2d::Zero();
      for (const Index k : all) middle += flat(k) / static_cast<double>(all.size());
      const auto angle = [&](Index k) {
        const Vector2d d = flat(k) - middle;
        return std::atan2(d.y(), d.x());
      };
      std::sort(loop.begin(), loop.end(), [&](Index a, Index b) { return angle(a) < angle(b); });
      std::rotate(loop.begin(),
                  std::min_element(loop.begin(), loop.end(),
                                   [&](Index a, Index b) {
                                     const Vector2d x = flat(a), y = flat(b);
                                     return x.x() < y.x() || (x.x() == y.x() && x.y() < y.y());
                                   }),
                  loop.end());
      ordered.push_back({{all[0], all[1], *third}, std::move(loop)});
    }
    std::sort(ordered.begin(), ordered.end());
    Faces out;
    for (auto& each : ordered) out.push_back(std::move(each.second));
    return out.size() < 4 ? Faces() : out;
  }

  const std::vector<Vector3d>& given_;
  double size_ = 0;
  std::vector<Vector3d> p_;  // in parts of the size
  std::set<std::vector<Index>> known_;
  std::vector<Face> faces_;
};

}  // namespace

Faces hull_faces(const std::vector<Vector3d>& points) {
  if (points.size() < 4) return {};
  return Hull(points).faces();
}

std::vector<Vector3d> points_of_faces(const std::vector<Vector3d>& points, const Faces& faces) {
  std::vector<char> is_corner(points.size(), 0);
  for (const std::vector<Index>& face : faces)
    for (const Index k : face) is_corner[k] = 1;
  std::vector<Vector3d> out;
  for (std::size_t k = 0; k < points.size(); ++k)
    if (is_corner[k] != 0) out.push_back(points[k]);
  return out;
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
    const std::size_t start = out.size();
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

}  // namespace tether::linalg
