// Tether: closed surfaces of triangles as convex parts (detection, section 5).
// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/contact/shapes.hpp>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/index.hpp>
#include <utility>

#include "problem/refuse.hpp"
#include "stepping/detection/clip.hpp"
#include "stepping/detection/mesh/closed_surface.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

namespace {

using Eigen::Vector3d;
using linalg::at;

// All lengths below are in units of the largest extent of the surface.
constexpr double kVolume = 1e-6;  // of the volume: parts of the surface's, where all are its own
constexpr std::size_t kMostParts = 1000;

using detail::ClosedSurface;
using detail::Hollow;
using detail::kInPlane;
using detail::Plane;
using detail::Polygon;
using detail::split_polygon;

/// A part of a triangle, in the plane `plane` of the surface.
struct Piece {
  Polygon corners;
  int plane;
};

/// A convex region that planes have cut out of a box around the surface, and what it has of the
/// surface and of its hollow edges.
struct Cell {
  std::vector<Polygon> walls;
  std::vector<Piece> surface;
  std::vector<Hollow> hollows;
};

enum class Side { in, below, above, both };

template <class Points>
Side side_of(const Points& points, const Plane& plane) {
  bool below = false, above = false;
  for (const Vector3d& p : points) {
    const double d = plane.height(p);
    below = below || d < -kInPlane;
    above = above || d > kInPlane;
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

/// All of the surface, in a box that it does not reach.
Cell whole(const ClosedSurface& surface) {
  Cell out;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      Polygon wall;
      for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
        Vector3d p = surface.middle();
        p[axis] += side;
        p[(axis + 1) % 3] += x;
        p[(axis + 2) % 3] += y;
        wall.push_back(p);
      }
      out.walls.push_back(wall);
    }
  for (int t = 0; t < surface.triangles(); ++t)
    out.surface.push_back(
        {{surface.corner(t, 0), surface.corner(t, 1), surface.corner(t, 2)}, surface.plane_of(t)});
  out.hollows = surface.hollows();
  return out;
}

/// Cuts cells by planes until each has a convex part of the solid.
class Splitter {
 public:
  Splitter(const ClosedSurface& solid, double concavity)
      : solid_(solid), concavity_(std::max(concavity / solid.unit(), kInPlane)) {}

  std::vector<std::vector<Vector3d>> parts() {
    std::vector<Cell> open{whole(solid_)};
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
    if (work_ > 4e9) too_much("takes too many comparisons");  // some ten seconds
  }
  [[noreturn]] void too_much(const std::string& what) const {
    solid_.demand_no_crossing();
    detail::refuse_mesh(
        what +
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
      split_polygon(each.corners, plane.normal, plane.offset, kInPlane, low, high);
      below.surface.push_back({low, each.plane});
      above.surface.push_back({high, each.plane});
    }
    for (const Hollow& h : cell.hollows) {
      const Side side = side_of(h, plane);
      if (side == Side::in) continue;
      if (side == Side::both) {
        const double d = plane.height(h.from), e = plane.height(h.to);
        const Vector3d x = h.from + d / (d - e) * (h.to - h.from);
        const bool rises = d < e;
        (rises ? below : above).hollows.push_back({h.from, x, h.plane});
        (rises ? above : below).hollows.push_back({x, h.to, h.plane});
      } else {
        (side == Side::below ? below : above).hollows.push_back(h);
      }
    }
    for (const Polygon& wall : cell.walls) {
      split_polygon(wall, plane.normal, plane.offset, kInPlane, low, high, &seam);
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
        return (p - q).cwiseAbs().maxCoeff() <= kInPlane;
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
    parts_.push_back(linalg::points_of_faces(points, faces));
  }

  const ClosedSurface& solid_;
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
  const ClosedSurface solid(mesh);
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
