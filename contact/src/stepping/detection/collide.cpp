// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/collide.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tether/linalg/index.hpp>
#include <utility>

#include "stepping/detection/convex_pair.hpp"
#include "stepping/detection/point_contacts.hpp"

namespace tether::contact {

using Eigen::Vector3d;

namespace {

// By kind. Of two shapes the one of lower rank comes first where their points are found.
struct KindTraits {
  const char* name;
  int rank;
};
constexpr std::array<KindTraits, kShapeKinds.size()> kTraits{{{"sphere", 0},
                                                              {"plane", 7},
                                                              {"box", 2},
                                                              {"capsule", 1},
                                                              {"convex", 5},
                                                              {"points", 6},
                                                              {"ellipsoid", 3},
                                                              {"cylinder", 4},
                                                              {"mesh", 8}}};

int rank(ShapeKind kind) { return kTraits[static_cast<std::size_t>(kind)].rank; }

Shape shape_of(ShapeKind kind) {
  Shape s;
  s.kind = kind;
  return s;
}

Shape about_axis(ShapeKind kind, double radius, double length) {
  Shape s = shape_of(kind);
  s.radius = radius;
  s.length = length;
  return s;
}

Shape of_size(ShapeKind kind, const Vector3d& size) {
  Shape s = shape_of(kind);
  s.size = size;
  return s;
}

Shape of_points(ShapeKind kind, std::vector<Vector3d> points) {
  Shape s = shape_of(kind);
  s.points = std::move(points);
  return s;
}

}  // namespace

const char* name(ShapeKind kind) { return kTraits[static_cast<std::size_t>(kind)].name; }

Shape Shape::sphere(double radius) {
  Shape s = shape_of(ShapeKind::sphere);
  s.radius = radius;
  return s;
}

Shape Shape::plane(const Vector3d& normal) {
  Shape s = shape_of(ShapeKind::plane);
  s.normal = normal.normalized();
  return s;
}

Shape Shape::box(const Vector3d& size) { return of_size(ShapeKind::box, size); }
Shape Shape::ellipsoid(const Vector3d& half_axes) {
  return of_size(ShapeKind::ellipsoid, half_axes);
}

Shape Shape::capsule(double radius, double length) {
  return about_axis(ShapeKind::capsule, radius, length);
}
Shape Shape::cylinder(double radius, double length) {
  return about_axis(ShapeKind::cylinder, radius, length);
}

Shape Shape::convex(std::vector<Vector3d> vertices) {
  return of_points(ShapeKind::convex, std::move(vertices));
}
Shape Shape::touching_points(std::vector<Vector3d> points) {
  return of_points(ShapeKind::points, std::move(points));
}

Shape Shape::mesh(std::vector<Vector3d> vertices, std::vector<std::array<int, 3>> triangles) {
  Shape s = of_points(ShapeKind::mesh, std::move(vertices));
  s.triangles = std::move(triangles);
  return s;
}

Shape Shape::height_field(const std::vector<double>& heights, int nx, double dx, double dy) {
  const int ny = nx > 0 ? static_cast<int>(heights.size()) / nx : 0;
  if (nx < 2 || ny < 2 || heights.size() != linalg::at(nx) * linalg::at(ny))
    throw std::invalid_argument("height_field: needs at least 2 x 2 heights, rows of nx");
  Shape s = shape_of(ShapeKind::mesh);
  for (int k = 0; k < ny; ++k)
    for (int i = 0; i < nx; ++i)
      s.points.emplace_back(i * dx, k * dy, heights[linalg::at(k * nx + i)]);
  for (int k = 0; k + 1 < ny; ++k)
    for (int i = 0; i + 1 < nx; ++i) {
      const int p = k * nx + i;
      s.triangles.push_back({p, p + 1, p + nx + 1});
      s.triangles.push_back({p, p + nx + 1, p + nx});
    }
  return s;
}

namespace detail {
namespace {

constexpr std::size_t kMostTriangles = 2000000;

// A point and a plane, by a point of it. `to_point` is its normal, towards the point.
void point_plane(const Vector3d& p, const Vector3d& plane, const Vector3d& to_point, double margin,
                 int feature, NearPoints& out) {
  const double gap = to_point.dot(p - plane);
  if (gap < margin) out.add(p, p - gap * to_point, to_point, gap, feature);
}

void ball_plane(const Vector3d& centre, double radius, const Vector3d& plane, const Vector3d& n,
                double margin, int feature, NearPoints& out) {
  const double distance = n.dot(centre - plane);
  if (distance - radius < margin)
    out.add(centre - radius * n, centre - distance * n, n, distance - radius, feature);
}

// Spheres of radii r1, r2 about the nearest points of two shapes.
void ball_ball(const Vector3d& c1, double r1, const Vector3d& c2, double r2, double margin,
               int feature, NearPoints& out) {
  const Vector3d d = c1 - c2;
  const double distance2 = d.squaredNorm(), sum = r1 + r2 + margin;
  if (!(distance2 < sum * sum)) return;
  const double distance = std::sqrt(distance2);
  const Vector3d n = distance > 0 ? Vector3d(d / distance) : Vector3d(Vector3d::UnitZ());
  out.add(c1 - r1 * n, c2 + r2 * n, n, distance - r1 - r2, feature);
}

void sphere_box(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
                NearPoints& out) {
  // In the axes of the box: differences of world positions have no direction on its surface.
  const Nearest at = nearest_on(b, B.rotation.transpose() * (A.position - B.position));
  if (!(at.gap - a.radius < margin)) return;
  const Vector3d n = B.rotation * at.normal;
  out.add(A.position - a.radius * n, B.position + B.rotation * at.point, n, at.gap - a.radius, 0);
}

Vector3d nearest_on_segment(const Vector3d& p, const Vector3d& from, const Vector3d& to) {
  const Vector3d d = to - from;
  const double length2 = d.squaredNorm();
  return length2 > 0 ? Vector3d(from + std::clamp((p - from).dot(d) / length2, 0.0, 1.0) * d)
                     : from;
}

struct Segment {
  Vector3d from, to;
};
Segment axis_of(const Shape& s, const Pose& P) {
  const Vector3d half = 0.5 * s.length * P.rotation.col(2);
  return {P.position - half, P.position + half};
}

// Near-parallel axes touch at two points: the ends of the part that they share.
void capsule_capsule(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
                     NearPoints& out) {
  const Segment s = axis_of(a, A), t = axis_of(b, B);
  const Vector3d u = s.to - s.from, v = t.to - t.from;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double square = uu * vv - uv * uv;
  if (square > 1e-4 * uu * vv) {
    const Vector3d w = s.from - t.from;
    double x = std::clamp((uv * v.dot(w) - vv * u.dot(w)) / square, 0.0, 1.0);
    const Vector3d q = nearest_on_segment(s.from + x * u, t.from, t.to);
    const Vector3d p = nearest_on_segment(q, s.from, s.to);
    ball_ball(p, a.radius, nearest_on_segment(p, t.from, t.to), b.radius, margin, 0, out);
    return;
  }
  for (int end = 0; end < 2; ++end) {
    const Vector3d q = nearest_on_segment(end == 0 ? s.from : s.to, t.from, t.to);
    const Vector3d p = nearest_on_segment(q, s.from, s.to);
    ball_ball(p, a.radius, q, b.radius, margin, 1 + end, out);
  }
}

// a of lower rank than b.
void collide_ordered(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
                     NearPoints& out) {
  if (b.kind == ShapeKind::plane)
    return collide_plane(a, A, B.position, B.rotation * b.normal, margin, out);
  if (is_convex_pair(a.kind, b.kind)) return collide_convex(a, A, b, B, margin, out);
  if (b.kind == ShapeKind::points) {
    if (a.kind == ShapeKind::points) return;  // points pass through each other
    const int from = out.count;
    collide_points(b, B, a, A, margin, out);
    return turn(out, from);
  }
  if (a.kind == ShapeKind::sphere) {
    if (b.kind == ShapeKind::sphere)
      return ball_ball(A.position, a.radius, B.position, b.radius, margin, 0, out);
    if (b.kind == ShapeKind::box) return sphere_box(a, A, b, B, margin, out);
    const Segment t = axis_of(b, B);
    return ball_ball(A.position, a.radius, nearest_on_segment(A.position, t.from, t.to), b.radius,
                     margin, 0, out);
  }
  capsule_capsule(a, A, b, B, margin, out);
}

}  // namespace

void collide_plane(const Shape& a, const Pose& A, const Vector3d& P, const Vector3d& n,
                   double margin, NearPoints& out) {
  switch (a.kind) {
    case ShapeKind::sphere:
      ball_plane(A.position, a.radius, P, n, margin, 0, out);
      break;
    case ShapeKind::capsule:
      for (int end = 0; end < 2; ++end)
        ball_plane(A.position + (end == 0 ? -0.5 : 0.5) * a.length * A.rotation.col(2), a.radius, P,
                   n, margin, end, out);
      break;
    case ShapeKind::box:
      for (int k = 0; k < 8; ++k) {
        const Vector3d corner((k & 1) != 0 ? 0.5 : -0.5, (k & 2) != 0 ? 0.5 : -0.5,
                              (k & 4) != 0 ? 0.5 : -0.5);
        point_plane(A.position + A.rotation * corner.cwiseProduct(a.size), P, n, margin, k, out);
      }
      break;
    case ShapeKind::convex:
    case ShapeKind::points:
      for (std::size_t k = 0; k < a.points.size(); ++k)
        point_plane(A.position + A.rotation * a.points[k], P, n, margin, static_cast<int>(k), out);
      break;
    case ShapeKind::ellipsoid:
      return ellipsoid_plane(a, A, P, n, margin, out);
    case ShapeKind::cylinder:
      return cylinder_plane(a, A, P, n, margin, out);
    case ShapeKind::plane:
    case ShapeKind::mesh:
      break;
  }
}

bool has_collision(ShapeKind a, ShapeKind b) {
  if (rank(a) > rank(b)) std::swap(a, b);
  if (b == ShapeKind::mesh) return rank(a) <= rank(ShapeKind::convex);  // by MeshContacts
  return b != ShapeKind::plane || a != ShapeKind::plane;
}

void collide(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
             NearPoints& out) {
  if (rank(a.kind) <= rank(b.kind)) return collide_ordered(a, A, b, B, margin, out);
  const int from = out.count;
  collide_ordered(b, B, a, A, margin, out);
  turn(out, from);
}

void turn(NearPoints& out, int from) {
  for (int k = from; k < out.count; ++k) {
    std::swap(out.point[k].on_first, out.point[k].on_second);
    out.point[k].normal = -out.point[k].normal;
  }
}

double reach(const Shape& s) {
  double most = 0;
  switch (s.kind) {
    case ShapeKind::sphere:
      return s.radius;
    case ShapeKind::capsule:
      return s.radius + 0.5 * s.length;
    case ShapeKind::box:
      return 0.5 * s.size.norm();
    case ShapeKind::ellipsoid:
      return s.size.maxCoeff();
    case ShapeKind::cylinder:
      return std::hypot(s.radius, 0.5 * s.length);
    case ShapeKind::convex:
    case ShapeKind::points:
    case ShapeKind::mesh:
      for (const Vector3d& p : s.points) most = std::max(most, p.norm());
      return most;
    case ShapeKind::plane:
      break;
  }
  return std::numeric_limits<double>::infinity();
}

namespace {

void check_mesh(const Shape& s) {
  const int count = static_cast<int>(s.points.size());
  if (count < 3 || s.triangles.empty() || s.points.size() > kMostTriangles ||
      s.triangles.size() > kMostTriangles)
    throw std::invalid_argument("mesh: needs 3 to " + std::to_string(kMostTriangles) +
                                " points and 1 to as many triangles");
  for (const Vector3d& p : s.points)
    if (!p.allFinite() || !(p.cwiseAbs().maxCoeff() < 1e100))
      throw std::invalid_argument("mesh: points must be finite, below 1e100 m");
  for (const std::array<int, 3>& t : s.triangles)
    for (const int k : t)
      if (k < 0 || k >= count)
        throw std::invalid_argument("mesh: a triangle names point " + std::to_string(k) + " of " +
                                    std::to_string(count));
  const auto flat = [&](const std::array<int, 3>& t) {
    const Vector3d& a = s.points[linalg::at(t[0])];
    return !((s.points[linalg::at(t[1])] - a).cross(s.points[linalg::at(t[2])] - a).stableNorm() >
             0);
  };
  if (std::all_of(s.triangles.begin(), s.triangles.end(), flat))
    throw std::invalid_argument("mesh: none of the triangles has an area");
}

}  // namespace

void check(const Shape& s) {
  const auto positive = [&](double x, const char* what) {
    if (!(x > 0) || !std::isfinite(x))
      throw std::invalid_argument(std::string(name(s.kind)) + ": " + what +
                                  " must be > 0 and finite");
  };
  if (!s.position.allFinite() || !(std::abs(s.orientation.norm() - 1) < 1e-6))
    throw std::invalid_argument(std::string(name(s.kind)) +
                                ": position must be finite, orientation a unit quaternion");
  switch (s.kind) {
    case ShapeKind::sphere:
      return positive(s.radius, "radius");
    case ShapeKind::capsule:
      positive(s.radius, "radius");
      if (s.length != 0) positive(s.length, "length");
      return;
    case ShapeKind::box:
      return positive(s.size.minCoeff(), "size");
    case ShapeKind::ellipsoid:
      positive(s.size.maxCoeff(), "half_axes");
      return positive(s.size.minCoeff(), "half_axes");
    case ShapeKind::cylinder:
      positive(s.radius, "radius");
      return positive(s.length, "length");
    case ShapeKind::plane:
      if (!(std::abs(s.normal.norm() - 1) < 1e-6))
        throw std::invalid_argument("plane: normal must be a unit vector");
      return;
    case ShapeKind::convex:
    case ShapeKind::points:
      if (s.points.size() < (s.kind == ShapeKind::convex ? 4u : 1u) || s.points.size() > 65536)
        throw std::invalid_argument(std::string(name(s.kind)) +
                                    ": needs 4 (points: 1) to 65536 points");
      for (const Vector3d& p : s.points)
        if (!p.allFinite())
          throw std::invalid_argument(std::string(name(s.kind)) + ": points must be finite");
      return positive(reach(s), "extent");
    case ShapeKind::mesh:
      return check_mesh(s);
  }
}

}  // namespace detail
}  // namespace tether::contact
