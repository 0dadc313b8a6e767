// Tether: ellipsoids. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::ellipsoid(const Vector3d& half_axes) {
  Shape s;
  s.kind = ShapeKind::ellipsoid;
  s.size = half_axes;
  return s;
}

namespace detail {
namespace {

// The nearest point x has p - x = t x / a^2 (component by component), with the largest t that puts
// x onto the surface. With the least half axis c: t = (u - 1) c^2, q = a^2 / c^2, and
//   |w(u)| = 1,   w = (q p / a) / (u + q - 1),   u > 0.
// 1 / |w| is concave, so that Newton's method for 1 / |w| = 1 from a u that is too small converges
// monotonically.
Nearest nearest_on(const Vector3d& a, const Vector3d& p) {
  int least = 0;
  const double c = a.minCoeff(&least);
  const Vector3d ratio = a / c;
  Vector3d more, z;  // q - 1; q |p| / a
  for (int k = 0; k < 3; ++k) {
    more[k] = (ratio[k] - 1) * (ratio[k] + 1);
    z[k] = ratio[k] * std::abs(p[k]) / c;
  }
  double slope = 0;
  const auto place = [&](double u) {
    Vector3d w = Vector3d::Zero();
    slope = 0;
    for (int k = 0; k < 3; ++k) {
      if (!(z[k] > 0)) continue;
      w[k] = z[k] / (u + more[k]);
      slope += w[k] * w[k] / (u + more[k]);
    }
    return w;
  };
  double u = std::max(0.0, (z - more).maxCoeff());
  Vector3d x = place(u);  // relative to the half axes
  if (u == 0 && x.squaredNorm() < 1) {
    // p lies on the disc in the middle plane whose points are equally near to both sides.
    x[least] = std::sqrt(1 - x.squaredNorm());
  } else {
    for (int k = 0; k < 100; ++k) {
      const double norm = x.norm(), step = (norm - 1) * norm * norm / slope;
      if (!(step > 1e-16 * u)) break;
      u += step;
      x = place(u);
    }
    x.normalize();
  }
  for (int k = 0; k < 3; ++k)
    if (p[k] < 0) x[k] = -x[k];
  Nearest out;
  out.point = x.cwiseProduct(a);
  out.normal = x.cwiseQuotient(ratio).normalized();
  out.gap = out.normal.dot(p - out.point);
  return out;
}

class EllipsoidForm final : public ShapeForm {
 public:
  EllipsoidForm() : ShapeForm(Family::curved, 3) {}
  void check(const Shape& s) const override {
    demand_positive(s, s.size.maxCoeff(), "half_axes");
    demand_positive(s, s.size.minCoeff(), "half_axes");
  }
  double reach(const Shape& s) const override { return s.size.maxCoeff(); }
  // h(m)^2 = m.Q m with Q = R diag(a^2, b^2, c^2) R': the lowest point is -Q n / h(n).
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    const Vector3d scaled = s.size.cwiseProduct(pose.rotation.transpose() * n);
    const Vector3d low =
        pose.position - pose.rotation * s.size.cwiseProduct(scaled) / scaled.norm();
    const double gap = n.dot(pose.position - plane) - scaled.norm();
    if (gap < margin) out.add(low, low - gap * n, n, gap, 0);
  }
  Nearest nearest(const Shape& s, const Vector3d& p) const override {
    return nearest_on(s.size, p);
  }
  bool has_nearest() const override { return true; }
  void begin(const Shape& s, ConvexShape& out) const override {
    out.half = s.size;
    out.thickness = out.half.minCoeff();
  }
  Vector3d farthest(const ConvexShape& s, const Vector3d& m, double less) const override {
    const Vector3d scaled = s.half.cwiseProduct(m);
    const double h = scaled.norm(), part = 1 - less;
    return h > 0 ? Vector3d(part / h * s.half.cwiseProduct(scaled)) : Vector3d(Vector3d::Zero());
  }
  Eigen::Matrix3d curvature(const ConvexShape& s, const Vector3d& m) const override {
    const Vector3d square = s.half.cwiseProduct(s.half), x = square.cwiseProduct(m);
    const double h = s.half.cwiseProduct(m).norm();
    const Eigen::Matrix3d H = square.asDiagonal();
    return H / h - x * x.transpose() / (h * h * h);
  }
};

}  // namespace

TETHER_SHAPE_FORM(ellipsoid, EllipsoidForm)

}  // namespace detail
}  // namespace tether::contact
