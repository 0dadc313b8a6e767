// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/collide.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;
using Family = ShapeForm::Family;

namespace {

// Clips a line or a face to another face, both seen along n. The identity of a cut is made of the
// edge and of the side that cuts it.
void clip_to_face(const Flat& face, const Vector3d& n, Flat& subject) {
  const double turn = face.normal.dot(n) < 0 ? -1 : 1;
  for (int k = 0; k < face.count && subject.count > 0; ++k) {
    const Vector3d& from = face.point[at(k)];
    const Vector3d inward = turn * n.cross(Vector3d(face.point[at((k + 1) % face.count)] - from));
    clip(subject, inward, from, k,
         [&](std::size_t j) { return kCut + (subject.id[j] * 61 + face.id[at(k)]) % 0x7000; });
  }
}

// Contacts of the line or face `subject` with the face of the other shape.
void over_face(const ConvexPair& pair, const Flat& face, Flat& subject, bool subject_is_a) {
  const Vector3d& n = pair.apart.normal;
  clip_to_face(face, n, subject);
  const double along = face.normal.dot(n);
  for (int k = 0; k < subject.count; ++k) {
    const Vector3d& x = subject.point[at(k)];
    const double height = face.normal.dot(x - face.point[0]) / along;
    if (subject_is_a)
      pair.add(x, height, subject.id[at(k)]);
    else
      pair.add(x - height * n, -height, subject.id[at(k)]);
  }
}

// Contacts of two lines: the ends of their common length, or the point where they cross.
void along_lines(const ConvexPair& pair, const Flat& s, const Flat& t) {
  const Vector3d& n = pair.apart.normal;
  const auto flatten = [&](const Vector3d& x) { return Vector3d(x - n.dot(x) * n); };
  const Vector3d u = flatten(s.point[1] - s.point[0]), v = flatten(t.point[1] - t.point[0]);
  const Vector3d w = flatten(t.point[0] - s.point[0]);
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), cross = n.dot(u.cross(v));
  const auto add = [&](double x, double y, int feature) {
    const Vector3d p = s.point[0] + x * (s.point[1] - s.point[0]);
    const Vector3d q = t.point[0] + y * (t.point[1] - t.point[0]);
    pair.add(p, n.dot(p - q), feature);
  };
  if (std::abs(cross) > kFlatAngle * std::sqrt(uu * vv)) {
    const double x = std::clamp(n.dot(w.cross(v)) / cross, 0.0, 1.0);
    const double y = std::clamp(n.dot(w.cross(u)) / cross, 0.0, 1.0);
    return add(x, y, 0x7f00);
  }
  const double end0 = u.dot(w) / uu, end1 = u.dot(w + v) / uu;
  const double from = std::max(0.0, std::min(end0, end1));
  const double to = std::min(1.0, std::max(end0, end1));
  const auto on_other = [&](double x) { return std::clamp(v.dot(x * u - w) / vv, 0.0, 1.0); };
  if (from >= to) {
    const double x = std::clamp(from, 0.0, 1.0);
    return add(x, on_other(x), 0x7f01);
  }
  add(from, on_other(from), 0x7f02);
  add(to, on_other(to), 0x7f03);
}

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

double ConvexPair::height() const {
  return std::min(margin - apart.gap, kHigh * std::min(a.thickness, b.thickness));
}

void ConvexPair::add(const Vector3d& on_a, double core_gap, int feature) const {
  const Vector3d& n = apart.normal;
  const double gap = core_gap - a.round - b.round;
  if (!(gap < margin)) return;
  const Vector3d x = origin + on_a - a.round * n;
  out.add(x, x - gap * n, n, gap, feature);
}

void manifold(const ConvexPair& pair, Flat& s, Flat& t) {
  const Vector3d& n = pair.apart.normal;
  const double thickness = std::min(pair.a.thickness, pair.b.thickness);
  const int before = pair.out.count;
  const bool on_s = s.count > 2, on_t = t.count > 2;
  if (s.count > 1 && t.count > 1) {
    if (on_t && (!on_s || t.normal.dot(n) >= -s.normal.dot(n)))
      over_face(pair, t, s, true);
    else if (on_s)
      over_face(pair, s, t, false);
    else
      along_lines(pair, s, t);
  }
  for (int k = before; k < pair.out.count; ++k)
    if (pair.out.point[at(k)].gap < pair.apart.gap + kNear * thickness) return;
  // No contact so far is at the lowest point. It is the point of a round surface, else the point at
  // which the shapes are nearest.
  Vector3d x = pair.apart.on_first;
  if (s.count == 1) x = s.point[0];
  if (s.count != 1 && t.count == 1) x = t.point[0];
  const double low = n.dot(pair.a.farthest(-n));
  x += (low - n.dot(x)) * n;
  pair.add(x, pair.apart.gap + pair.a.round + pair.b.round, 0x7f04);
}

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
