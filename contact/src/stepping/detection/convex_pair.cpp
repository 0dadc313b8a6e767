// Tether: ellipsoids and cylinders against convex shapes. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/convex_pair.hpp"

#include <cmath>

#include "stepping/detection/manifold.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

bool has_inside(ShapeKind k) {
  return k != ShapeKind::plane && k != ShapeKind::points && k != ShapeKind::mesh;
}
bool is_curved(ShapeKind k) { return k == ShapeKind::ellipsoid || k == ShapeKind::cylinder; }

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
  const ConvexPair pair{first, second, origin, apart, margin, out};
  Flat on_first, on_second;
  first.flat(-apart.normal, pair.height(), on_first);
  second.flat(apart.normal, pair.height(), on_second);
  manifold(pair, on_first, on_second);
}

// h(m)^2 = m.Q m with Q = R diag(a^2, b^2, c^2) R': the lowest point is -Q n / h(n).
void ellipsoid_plane(const Shape& a, const Pose& A, const Vector3d& P, const Vector3d& n,
                     double margin, NearPoints& out) {
  const Vector3d scaled = a.size.cwiseProduct(A.rotation.transpose() * n);
  const Vector3d low = A.position - A.rotation * a.size.cwiseProduct(scaled) / scaled.norm();
  const double gap = n.dot(A.position - P) - scaled.norm();
  if (gap < margin) out.add(low, low - gap * n, n, gap, 0);
}

// The lowest points of both rims, and three more of the lower one: a standing cylinder has four.
// They turn with the tilt, so that the rim on which it tips is always among them.
void cylinder_plane(const Shape& a, const Pose& A, const Vector3d& P, const Vector3d& n,
                    double margin, NearPoints& out) {
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
      const double gap = n.dot(p - P);
      if (gap < margin) out.add(p, p - gap * n, n, gap, 4 * end + k);
    }
  }
}

}  // namespace tether::contact::detail
