// Tether: closed surfaces of triangles as convex parts (detection, section 5).
// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <tether/contact/shapes.hpp>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>
#include <tether/linalg/pi.hpp>
#include <utility>

#include "problem/refuse.hpp"
#include "stepping/detection/clip.hpp"
#include "stepping/detection/mesh/triangle_mesh.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

namespace {

using Eigen::Vector3d;
using linalg::at;

// All lengths below are in units of the largest extent of the surface.
constexpr double kOn = 1e-7;  // nearer to a plane: in it, as for hulls (linalg/convex_hull.hpp)
constexpr double kNoArea = 1e-14;  // least ratio of twice the area to the longest edge squared
constexpr double kVolume = 1e-6;   // of the volume: parts of the surface's, where all are its own
constexpr std::size_t kMostParts = 1000, kMostTriangles = 20000;
constexpr double kMostWork = 4e9;  // comparisons of a point with a plane, some ten seconds

using detail::Polygon;
using detail::split_polygon;

struct Plane {
  Vector3d normal;
  double offset;
  double height(const Vector3d& p) const { return normal.dot(p) - offset; }
};

/// A part of a triangle, in the plane `plane` of the surface.
struct Piece {
  Polygon corners;
  int plane;
};

/// A part of an edge at which the solid is not convex, with the planes of its triangles.
struct Hollow {
  Vector3d from, to;
  std::array<int, 2> plane;
};

/// A convex region that planes have cut out of a box around the surface, and what it has of the
/// surface and of its hollow edges.
struct Cell {
  std::vector<Polygon> walls;
  std::vector<Piece> surface;
  std::vector<Hollow> hollows;
};

std::string listed(const std::array<int, 3>& t) {
  return "[" + std::to_string(t[0]) + ", " + std::to_string(t[1]) + ", " + std::to_string(t[2]) +
         "]";
}

[[noreturn]] void wrong(const std::string& what) { throw std::invalid_argument("mesh: " + what); }

enum class Side { in, below, above, both };

template <class Points>
Side side_of(const Points& points, const Plane& plane) {
  bool below = false, above = false;
  for (const Vector3d& p : points) {
    const double d = plane.height(p);
    below = below || d < -kOn;
    above = above || d > kOn;
  }
  return below ? (above ? Side::both : Side::below) : (above ? Side::above : Side::in);
}
Side side_of(const Hollow& h, const Plane& plane) {
  return side_of(std::array<Vector3d, 2>{h.from, h.to}, plane);
}

double volume_of(const std::vector<Vector3d>& points,
                 const std::vector<std::vector<std::size_t>>& faces) {
  double six = 0;
  for (const std::vector<std::size_t>& f : faces)
    for (std::size_t k = 1; k + 1 < f.size(); ++k)
      six += points[f[0]].dot(points[f[k]].cross(points[f[k + 1]]));
  return six / 6;
}

/// The closed surface of a mesh: checked, its edges joined, in units of its extent.
class Solid {
 public:
  explicit Solid(const Shape& mesh) : triangles_(mesh.triangles) {
    if (triangles_.size() > kMostTriangles)
      wrong("has " + std::to_string(triangles_.size()) +
            " triangles; on a body that moves at most " + std::to_string(kMostTriangles) +
            " are split into convex parts");
    set_points(mesh.points);
    join_edges();
    if (!(volume_ > 0))
      detail::refuse("mesh: volume within the triangles", volume_ * std::pow(unit_, 3),
                     "must be > 0 m^3: they run counterclockwise seen from outside; exchange two "
                     "corners of each");
  }

  double unit() const { return unit_; }
  double volume() const { return volume_; }
  const Plane& plane(int k) const { return planes_[at(k)]; }

  /// All of the surface, in a box that it does not reach.
  Cell whole() const {
    Cell out;
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        Polygon wall;
        for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
          Vector3d p = middle_;
          p[axis] += side;
          p[(axis + 1) % 3] += x;
          p[(axis + 2) % 3] += y;
          wall.push_back(p);
        }
        out.walls.push_back(wall);
      }
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t)
      out.surface.push_back({{corner(t, 0), corner(t, 1), corner(t, 2)}, plane_[at(t)]});
    out.hollows = hollows_;
    return out;
  }

  /// Whether a point is inside and not on the surface, from the solid angle of that (A. Van
  /// Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30, 1983, 125).
  bool contains(const Vector3d& p) const {
    double angle = 0;
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) {
      if (is_over(t, p, -kOn) && std::abs(normal_[at(t)].dot(p - corner(t, 0))) <= kOn)
        return false;
      const Vector3d a = corner(t, 0) - p, b = corner(t, 1) - p, c = corner(t, 2) - p;
      const double x = a.norm(), y = b.norm(), z = c.norm();
      angle +=
          std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
    }
    return angle > linalg::kPi;  // half of 4 pi, in halves
  }

  /// Throws std::invalid_argument if two triangles pass through each other.
  void demand_no_crossing() const {
    const int n = static_cast<int>(triangles_.size());
    std::vector<std::array<Vector3d, 2>> box;
    std::vector<int> order(at(n));
    for (int t = 0; t < n; ++t) {
      order[at(t)] = t;
      box.push_back({corner(t, 0).cwiseMin(corner(t, 1)).cwiseMin(corner(t, 2)),
                     corner(t, 0).cwiseMax(corner(t, 1)).cwiseMax(corner(t, 2))});
    }
    std::sort(order.begin(), order.end(),
              [&](int a, int b) { return box[at(a)][0].x() < box[at(b)][0].x(); });
    for (std::size_t i = 0; i < order.size(); ++i)
      for (std::size_t k = i + 1; k < order.size(); ++k) {
        const auto &a = box[at(order[i])], &b = box[at(order[k])];
        if (b[0].x() > a[1].x()) break;
        if ((b[0].array() > a[1].array()).any() || (a[0].array() > b[1].array()).any()) continue;
        if (passes(order[i], order[k]) || passes(order[k], order[i]))
          wrong("triangles " + std::to_string(std::min(order[i], order[k])) + " and " +
                std::to_string(std::max(order[i], order[k])) +
                " pass through each other; a surface that bounds a solid does not");
      }
  }

 private:
  const Vector3d& corner(int t, int k) const {
    return points_[at(number_[at(triangles_[at(t)][at(k)])])];
  }

  void set_points(const std::vector<Vector3d>& points) {
    Vector3d low = points.front(), high = low;
    for (const Vector3d& p : points) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    // A power of two scales without rounding.
    unit_ = std::exp2(std::ceil(std::log2((high - low).maxCoeff())));
    middle_ = (low / unit_ + high / unit_) / 2;
    number_ = detail::welded(points, points_);
    for (Vector3d& p : points_) p /= unit_;
  }

  void join_edges() {
    std::map<std::pair<int, int>, int> left;  // triangle on the left of a directed edge
    const int n = static_cast<int>(triangles_.size());
    for (int t = 0; t < n; ++t) {
      const Vector3d u = corner(t, 1) - corner(t, 0), v = corner(t, 2) - corner(t, 0);
      const double longest2 = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
      if (!(u.cross(v).norm() > kNoArea * longest2))
        wrong("triangle " + std::to_string(t) + ", " + listed(triangles_[at(t)]) +
              ", has no area: leave it out and join the points of its neighbours");
      normal_.push_back(u.cross(v).normalized());
      area_.push_back(u.cross(v).norm());
      volume_ += corner(t, 0).dot(corner(t, 1).cross(corner(t, 2))) / 6;
      for (int k = 0; k < 3; ++k) {
        const auto [known, fresh] = left.emplace(ends(t, k), t);
        if (!fresh)
          wrong(
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
          wrong("the edge " + edge(t, k) + " of triangle " + std::to_string(t) +
                " belongs to no other triangle: the surface of a body that moves must be closed");
        if ((normal_[at(t)] - normal_[at(other->second)]).norm() < kFlat)
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
      if (rise > kOn)
        hollows_.push_back({points_[at(pair.first)], points_[at(pair.second)], {p, q}});
    }
  }

  // Flat parts have the plane of their largest triangle.
  void set_planes(linalg::DisjointSets& flat) {
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

  std::pair<int, int> ends(int t, int k) const {
    return {number_[at(triangles_[at(t)][at(k)])], number_[at(triangles_[at(t)][at((k + 1) % 3)])]};
  }
  std::string edge(int t, int k) const {
    return "[" + std::to_string(triangles_[at(t)][at(k)]) + ", " +
           std::to_string(triangles_[at(t)][at((k + 1) % 3)]) + "]";
  }

  // Whether an edge of triangle s passes through the inside of triangle t.
  bool passes(int s, int t) const {
    const Vector3d& n = normal_[at(t)];
    for (int k = 0; k < 3; ++k) {
      const Vector3d &p = corner(s, k), &q = corner(s, (k + 1) % 3);
      const double d = n.dot(p - corner(t, 0)), e = n.dot(q - corner(t, 0));
      if (!(std::min(d, e) < -kOn && std::max(d, e) > kOn)) continue;
      if (is_over(t, p + d / (d - e) * (q - p), kOn)) return true;
    }
    return false;
  }

  // Whether the foot of x in the plane of a triangle is in it, so far from its edges.
  bool is_over(int t, const Vector3d& x, double within) const {
    for (int k = 0; k < 3; ++k) {
      const Vector3d along = (corner(t, (k + 1) % 3) - corner(t, k)).normalized();
      if (!(normal_[at(t)].cross(along).dot(x - corner(t, k)) > within)) return false;
    }
    return true;
  }

  static constexpr double kFlat = 1e-9;  // radian: smaller bends between triangles are rounding

  const std::vector<std::array<int, 3>>& triangles_;
  std::vector<Vector3d> points_;  // without doubles
  std::vector<int> number_;       // of each given point, in points_
  std::vector<Vector3d> normal_;
  std::vector<double> area_;  // twice
  std::vector<int> plane_;    // of each triangle
  std::vector<Plane> planes_;
  std::vector<Hollow> hollows_;
  Vector3d middle_ = Vector3d::Zero();
  double unit_ = 1, volume_ = 0;
};

/// Cuts cells by planes until each has a convex part of the solid.
class Splitter {
 public:
  Splitter(const Solid& solid, double concavity)
      : solid_(solid), concavity_(std::max(concavity / solid.unit(), kOn)) {}

  std::vector<std::vector<Vector3d>> parts() {
    std::vector<Cell> open{solid_.whole()};
    while (!open.empty()) {
      const Cell cell = std::move(open.back());
      open.pop_back();
      if (cell.surface.empty()) continue;
      std::vector<Plane> cuts;
      if (!find_cuts(cell, cuts)) {
        add_part(cell);
        continue;
      }
      const Plane plane = best_of(cell, cuts);
      Cell below, above;
      cut(cell, plane, below, above);
      open.push_back(std::move(above));
      open.push_back(std::move(below));
    }
    return std::move(parts_);
  }
  double volume() const { return volume_; }

 private:
  void work(std::size_t amount) {
    work_ += static_cast<double>(amount);
    if (work_ > kMostWork) too_much("takes too many comparisons");
  }
  [[noreturn]] void too_much(const std::string& what) const {
    solid_.demand_no_crossing();
    wrong(what +
          " to split into convex parts: give concavity, the depth in m of hollows that parts "
          "may fill, or a surface of fewer triangles");
  }

  // The planes of triangles which some of the surface is in front of by more than the concavity,
  // and those that halve the angles of hollow edges. False: there is no such triangle.
  bool find_cuts(const Cell& cell, std::vector<Plane>& cuts) {
    std::vector<int> planes;
    std::size_t corners = 0;
    for (const Piece& each : cell.surface) {
      planes.push_back(each.plane);
      corners += each.corners.size();
    }
    std::sort(planes.begin(), planes.end());
    planes.erase(std::unique(planes.begin(), planes.end()), planes.end());
    work(planes.size() * corners);
    for (const int p : planes) {
      double height = 0;
      for (const Piece& each : cell.surface)
        for (const Vector3d& x : each.corners) height = std::max(height, solid_.plane(p).height(x));
      if (height > concavity_) cuts.push_back(solid_.plane(p));
    }
    faces_ = cuts.size();
    if (cuts.empty()) return false;
    for (const Hollow& h : cell.hollows) {
      const Vector3d m =
          (solid_.plane(h.plane[0]).normal - solid_.plane(h.plane[1]).normal).normalized();
      cuts.push_back({m, m.dot(h.from)});
    }
    return true;
  }

  // The plane after which the fewest hollow edges are left; then that of a triangle rather than of
  // an edge, then that which cuts fewer triangles, then that which halves their number, so that few
  // parts are left where hollows may stay; then the first.
  Plane best_of(const Cell& cell, const std::vector<Plane>& cuts) {
    work(2 * cuts.size() * cell.hollows.size());
    std::array<std::size_t, 4> least{};
    const Plane* best = nullptr;
    for (std::size_t k = 0; k < cuts.size(); ++k) {
      std::array<std::size_t, 4> score{0, k < faces_ ? 0u : 1u, 0, 0};
      for (const Hollow& h : cell.hollows) {
        const Side side = side_of(h, cuts[k]);
        score[0] += side == Side::in ? 0 : side == Side::both ? 2 : 1;
      }
      if (best != nullptr && score[0] > least[0]) continue;
      work(3 * cell.surface.size());
      std::size_t below = 0, above = 0;
      for (const Piece& each : cell.surface) {
        const Side side = side_of(each.corners, cuts[k]);
        if (side == Side::both) ++score[2];
        if (side == Side::below || side == Side::both) ++below;
        if (side == Side::above || side == Side::both) ++above;
      }
      score[3] = std::max(below, above) - std::min(below, above);
      const bool parts = k < faces_ || (below > 0 && above > 0);
      if (!parts || (best != nullptr && !(score < least))) continue;
      least = score;
      best = &cuts[k];
    }
    return *best;
  }

  void cut(const Cell& cell, const Plane& plane, Cell& below, Cell& above) {
    work(cell.surface.size() + cell.walls.size() + cell.hollows.size());
    Polygon low, high, seam;
    for (const Piece& each : cell.surface) {
      const Side side = side_of(each.corners, plane);
      const bool along = plane.normal.dot(solid_.plane(each.plane).normal) > 0;
      if (side == Side::below || (side == Side::in && along)) below.surface.push_back(each);
      if (side == Side::above || (side == Side::in && !along)) above.surface.push_back(each);
      if (side != Side::both) continue;
      split_polygon(each.corners, plane.normal, plane.offset, kOn, low, high);
      below.surface.push_back({low, each.plane});
      above.surface.push_back({high, each.plane});
    }
    for (const Hollow& h : cell.hollows) {
      const double d = plane.height(h.from), e = plane.height(h.to);
      const Vector3d x = h.from + d / (d - e) * (h.to - h.from);
      const Side side = side_of(h, plane);
      if (side == Side::in) continue;
      const bool rises = d < e;
      if (side == Side::both) {
        (rises ? below : above).hollows.push_back({h.from, x, h.plane});
        (rises ? above : below).hollows.push_back({x, h.to, h.plane});
      } else {
        (side == Side::below ? below : above).hollows.push_back(h);
      }
    }
    for (const Polygon& wall : cell.walls) {
      split_polygon(wall, plane.normal, plane.offset, kOn, low, high, &seam);
      if (low.size() > 2) below.walls.push_back(low);
      if (high.size() > 2) above.walls.push_back(high);
    }
    const Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
    std::vector<Eigen::Vector2d> flat;
    for (const Vector3d& p : seam) flat.emplace_back(u.dot(p), v.dot(p));
    Polygon wall;
    for (const std::size_t k : linalg::hull_corners(flat)) wall.push_back(seam[k]);
    if (wall.size() < 3) return;
    below.walls.push_back(wall);
    above.walls.push_back(std::move(wall));
  }

  // The hull of the surface in the cell, and of the cell's corners in the solid.
  void add_part(const Cell& cell) {
    std::vector<Vector3d> points;
    const auto add = [&](const Vector3d& p) {
      const bool known = std::any_of(points.begin(), points.end(), [&](const Vector3d& q) {
        return (p - q).cwiseAbs().maxCoeff() <= kOn;
      });
      if (!known) points.push_back(p);
      return !known;
    };
    for (const Piece& each : cell.surface)
      for (const Vector3d& p : each.corners) add(p);
    const std::size_t of_surface = points.size();
    for (const Polygon& wall : cell.walls)
      for (const Vector3d& p : wall) add(p);
    work(40 * (points.size() - of_surface) * cell.surface.size());
    points.erase(
        std::remove_if(points.begin() + static_cast<std::ptrdiff_t>(of_surface), points.end(),
                       [&](const Vector3d& p) { return !solid_.contains(p); }),
        points.end());
    const std::vector<std::vector<std::size_t>> faces = linalg::hull_faces(points);
    if (faces.empty()) return;  // thinner than a plane is
    if (parts_.size() == kMostParts)
      too_much("has more than " + std::to_string(kMostParts) + " convex parts, too many");
    volume_ += volume_of(points, faces);
    std::vector<char> is_corner(points.size(), 0);
    for (const std::vector<std::size_t>& face : faces)
      for (const std::size_t k : face) is_corner[k] = 1;
    std::vector<Vector3d> corners;
    for (std::size_t k = 0; k < points.size(); ++k)
      if (is_corner[k] != 0) corners.push_back(points[k]);
    parts_.push_back(std::move(corners));
  }

  const Solid& solid_;
  double concavity_, work_ = 0, volume_ = 0;
  std::size_t faces_ = 0;  // cuts that are planes of triangles
  std::vector<std::vector<Vector3d>> parts_;
};

}  // namespace

std::vector<Shape> convex_parts(const Shape& mesh) {
  if (mesh.kind != ShapeKind::mesh)
    throw std::invalid_argument(std::string(name(mesh.kind)) + ": only a mesh has convex parts");
  if (!(mesh.concavity >= 0)) detail::refuse("mesh: concavity", mesh.concavity, "must be >= 0 m");
  detail::form(ShapeKind::mesh).check(mesh);
  const Solid solid(mesh);
  Splitter splitter(solid, mesh.concavity);
  std::vector<std::vector<Vector3d>> parts = splitter.parts();
  const double volume = solid.volume(), off = splitter.volume() / volume - 1;
  if (!(off > -kVolume) || (mesh.concavity == 0 && !(off < kVolume))) {
    solid.demand_no_crossing();
    detail::refuse("mesh: volume of its parts over that within its triangles", 1 + off,
                   "must be 1: no closed piece of it lies in another one that is turned the same "
                   "way");
  }
  std::vector<Shape> out;
  for (std::vector<Vector3d>& part : parts) {
    Shape s = Shape::convex({});
    Vector3d middle = Vector3d::Zero();
    for (Vector3d& p : part) middle += (p *= solid.unit()) / static_cast<double>(part.size());
    for (const Vector3d& p : part) s.points.push_back(p - middle);
    s.position = mesh.position + mesh.orientation * middle;
    s.orientation = mesh.orientation;
    out.push_back(std::move(s));
  }
  // A convex mesh keeps its points.
  if (out.size() == 1 && mesh.concavity == 0) {
    std::vector<char> used(mesh.points.size(), 0);
    for (const std::array<int, 3>& t : mesh.triangles)
      for (const int k : t) used[at(k)] = 1;
    out[0].points.clear();
    for (std::size_t k = 0; k < used.size(); ++k)
      if (used[k] != 0) out[0].points.push_back(mesh.points[k]);
    out[0].position = mesh.position;
  }
  return out;
}

}  // namespace tether::contact
