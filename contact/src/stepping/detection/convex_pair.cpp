// Tether: ellipsoids and cylinders against convex shapes. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/convex_pair.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "stepping/detection/convex_shape.hpp"
#include "stepping/detection/nearest_directions.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr double kParallelLines = 0.05;  // sine: lines that touch along each other

constexpr double kHigh = 0.1;  // of the thickness: what may lie against a surface
constexpr double kLow = 1e-6;  // above the lowest point

bool has_inside(ShapeKind k) { return k != ShapeKind::plane && k != ShapeKind::points; }
bool is_curved(ShapeKind k) { return k == ShapeKind::ellipsoid || k == ShapeKind::cylinder; }

// Both shapes of a pair about a common origin, and where their points go.
struct ConvexPair {
  const ConvexShape &a, &b;
  const Vector3d& origin;
  const Separation& apart;
  double margin;
  NearPoints& out;

  // Points of the shapes without their radius, on a line along the normal.
  void add(const Vector3d& on_a, double core_gap, int feature) const {
    const Vector3d& n = apart.normal;
    const double gap = core_gap - a.radius() - b.radius();
    if (!(gap < margin)) return;
    const Vector3d x = origin + on_a - a.radius() * n;
    out.add(x, x - gap * n, n, gap, feature);
  }
};

// What is left of a line or a face over another face, seen along n; cuts share the identity of the
// edge and of what cuts it.
void clip(const Flat& face, const Vector3d& n, Flat& subject) {
  const double turn = face.normal.dot(n) < 0 ? -1 : 1;
  for (int k = 0; k < face.count && subject.count > 0; ++k) {
    const Vector3d& from = face.point[at(k)];
    const Vector3d inward = turn * n.cross(Vector3d(face.point[at((k + 1) % face.count)] - from));
    Flat kept;
    for (int j = 0; j < subject.count; ++j) {
      const int next = (j + 1) % subject.count;
      const Vector3d &p = subject.point[at(j)], &q = subject.point[at(next)];
      const double d = inward.dot(p - from), e = inward.dot(q - from);
      if (d >= 0) kept.add(p, subject.id[at(j)]);
      if ((d >= 0) == (e >= 0)) continue;
      if (subject.count == 2 && j == 1) continue;  // the same edge, back
      kept.add(p + d / (d - e) * (q - p),
               0x800 + (subject.id[at(j)] * 61 + face.id[at(k)]) % 0x7000);
    }
    kept.normal = subject.normal;
    subject = kept;
  }
}

// Points of `subject` over (or, for_a, of a under) the face of the other shape.
void over_face(const ConvexPair& pair, const Flat& face, Flat& subject, bool subject_is_a) {
  const Vector3d& n = pair.apart.normal;
  clip(face, n, subject);
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

// Lines against each other: the ends of what they share, or where they cross.
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
  if (std::abs(cross) > kParallelLines * std::sqrt(uu * vv)) {
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

// All points at which the surfaces lie against each other across the normal.
void manifold(const ConvexPair& pair) {
  const Vector3d& n = pair.apart.normal;
  const double thickness = std::min(pair.a.thickness(), pair.b.thickness());
  const double height = std::min(pair.margin - pair.apart.gap, kHigh * thickness);
  Flat s, t;
  pair.a.flat(-n, height, s);
  pair.b.flat(n, height, t);
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
    if (pair.out.point[at(k)].gap < pair.apart.gap + kLow * thickness) return;
  // A point: of a surface without lines, else where the shapes are nearest.
  Vector3d x = pair.apart.on_first;
  if (s.count == 1) x = s.point[0];
  if (s.count != 1 && t.count == 1) x = t.point[0];
  const double low = n.dot(pair.a.farthest(-n));
  x += (low - n.dot(x)) * n;
  pair.add(x, pair.apart.gap + pair.a.radius() + pair.b.radius(), 0x7f04);
}

}  // namespace

bool is_convex_pair(ShapeKind a, ShapeKind b) {
  return has_inside(a) && has_inside(b) && (is_curved(a) || is_curved(b));
}

void collide_convex(const Shape& a, const Pose& A, const Shape& b, const Pose& B, double margin,
                    NearPoints& out) {
  const Vector3d origin = A.position;
  const ConvexShape first(a, A, origin), second(b, B, origin);
  Separation apart;
  if (!find_separation(first, second, margin, apart)) return;
  manifold({first, second, origin, apart, margin, out});
}

// h(m)^2 = m.Q m with Q = R diag(a^2, b^2, c^2) R': the lowest point is -Q n / h(n).
void ellipsoid_plane(const Shape& a, const Pose& A, const Pose& P, const Vector3d& n, double margin,
                     NearPoints& out) {
  const Vector3d scaled = a.size.cwiseProduct(A.rotation.transpose() * n);
  const Vector3d low = A.position - A.rotation * a.size.cwiseProduct(scaled) / scaled.norm();
  const double gap = n.dot(A.position - P.position) - scaled.norm();
  if (gap < margin) out.add(low, low - gap * n, n, gap, 0);
}

// The lowest points of both rims, and three more of the lower one: a standing cylinder has four.
// They turn with the tilt, so that the rim on which it tips is always among them.
void cylinder_plane(const Shape& a, const Pose& A, const Pose& P, const Vector3d& n, double margin,
                    NearPoints& out) {
  const Vector3d z = A.rotation.col(2);
  const double along = z.dot(n);
  const Vector3d across = z.cross(z.cross(n));  // along z - n, without its cancellation
  const double tilt = across.norm();
  const Vector3d down = tilt > 1e-9 ? Vector3d(across / tilt) : Vector3d(A.rotation.col(0));
  const Vector3d side = z.cross(down);
  const int lower = along < 0 ? 1 : 0;
  for (int end = 0; end < 2; ++end) {
    const Vector3d cap = A.position + (end == 0 ? -0.5 : 0.5) * a.length * z;
    for (int k = 0; k < (end == lower ? 4 : 1); ++k) {
      const Vector3d way = k % 2 == 0 ? down : side;
      const Vector3d p = cap + (k < 2 ? a.radius : -a.radius) * way;
      const double gap = n.dot(p - P.position);
      if (gap < margin) out.add(p, p - gap * n, n, gap, 4 * end + k);
    }
  }
}

}  // namespace tether::contact::detail
