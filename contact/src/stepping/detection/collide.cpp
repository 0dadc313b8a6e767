// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/collide.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "stepping/detection/manifold.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using Family = ShapeForm::Family;

namespace {

// Two balls with centres c1, c2; capsules pass the nearest points of their axes.
void ball_ball(const Vector3d& c1, double r1, const Vector3d& c2, double r2, double margin,
               int feature, NearPoints& out) {
  const Vector3d d = c1 - c2;
  const double distance2 = d.squaredNorm(), sum = r1 + r2 + margin;
  if (!(distance2 < sum * sum)) return;
  const double distance = std::sqrt(distance2);
  const Vector3d n = distance > 0 ? Vector3d(d / distance) : Vector3d(Vector3d::UnitZ());
  out.add(c1 - r1 * n, c2 + r2 * n, n, distance - r1 - r2, feature);
}

void sphere_on(const Shape& a, const Pose& A, const ShapeForm& of_b, const Shape& b, const Pose& B,
               double margin, NearPoints& out) {
  // Computed in the axes of the other shape. Near its surface a difference of world positions is
  // rounding, and has no direction.
  const Nearest at = of_b.nearest(b, B.rotation.transpose() * (A.position - B.position));
  if (!(at.gap - a.radius < margin)) return;
  const Vector3d n = B.rotation * at.normal;
  out.add(A.position - a.radius * n, B.position + B.rotation * at.point, n, at.gap - a.radius, 0);
}

// Each of the touching points against another shape. Normals point towards the points.
void points_on(const Shape& points, const Pose& pose, const ShapeForm& other, const Shape& shape,
               const Pose& shape_pose, double margin, NearPoints& out) {
  // The difference of the two positions comes first, so that bodies far from the origin lose no
  // digits.
  const Eigen::Matrix3d turn = shape_pose.rotation.transpose();
  const Vector3d between = pose.position - shape_pose.position;
  for (std::size_t k = 0; k < points.points.size(); ++k) {
    const Vector3d arm = pose.rotation * points.points[k];
    const Nearest at = other.nearest(shape, turn * (between + arm));
    if (at.gap < margin)
      out.add(pose.position + arm, shape_pose.position + shape_pose.rotation * at.point,
              shape_pose.rotation * at.normal, at.gap, static_cast<int>(k));
  }
}

// Ellipsoids and cylinders against any solid shape (detection, section 3).
void collide_convex(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
                    NearPoints& out) {
  const Vector3d origin = A.position;
  const ConvexShape first(a, A, origin), second(b, B, origin);
  Separation apart;
  if (!find_separation(first, second, margin, apart)) return;
  const ConvexPair pair{first, second, origin, apart, margin, out};
  Flat on_first, on_second;
  first.flat(-apart.normal, pair.height(), on_first);
  second.flat(apart.normal, pair.height(), on_second);
  manifold(pair, on_first, on_second);
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

// Capsules with nearly parallel axes touch at two points, the ends of their common length.
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

// Requires that the rank of a is at most that of b.
void collide_ordered(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
                     NearPoints& out) {
  if (a.kind == ShapeKind::sphere && b.kind == ShapeKind::sphere)
    return ball_ball(A.position, a.radius, B.position, b.radius, margin, 0, out);
  const ShapeForm &of_a = form(a.kind), &of_b = form(b.kind);
  if (of_b.family() == Family::plane)
    return of_a.on_plane(a, A, B.position, B.rotation * b.normal, margin, out);
  if (of_b.family() == Family::points) {
    if (of_a.family() == Family::points) return;  // they pass through each other
    const int from = out.count;
    points_on(b, B, of_a, a, A, margin, out);
    return turn(out, from);
  }
  if (of_a.family() == Family::curved || of_b.family() == Family::curved)
    return collide_convex(a, A, b, B, margin, out);
  if (of_b.family() != Family::ball) return sphere_on(a, A, of_b, b, B, margin, out);
  if (a.kind == ShapeKind::capsule) return capsule_capsule(a, A, b, B, margin, out);
  const Segment t = axis_of(b, B);
  ball_ball(A.position, a.radius, nearest_on_segment(A.position, t.from, t.to), b.radius, margin, 0,
            out);
}

}  // namespace

bool has_collision(ShapeKind a, ShapeKind b) {
  if (form(a).rank() > form(b).rank()) std::swap(a, b);
  if (form(b).family() == Family::mesh) return form(a).has_inside();  // by MeshContacts
  return form(b).family() != Family::plane || form(a).family() != Family::plane;
}

void collide(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
             NearPoints& out) {
  if (a.kind == b.kind || form(a.kind).rank() <= form(b.kind).rank())
    return collide_ordered(a, A, b, B, margin, out);
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

void check(const Shape& s) {
  if (!s.position.allFinite() || !(std::abs(s.orientation.norm() - 1) < 1e-6))
    throw std::invalid_argument(std::string(name(s.kind)) +
                                ": position must be finite, orientation a unit quaternion");
  form(s.kind).check(s);
}

}  // namespace tether::contact::detail
