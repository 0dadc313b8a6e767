// Tether: cylinders. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <tether/linalg/pi.hpp>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::cylinder(double radius, double length) {
  Shape s;
  s.kind = ShapeKind::cylinder;
  s.radius = radius;
  s.length = length;
  return s;
}

namespace detail {
namespace {

constexpr int kRim = 8;  // points of a rim

// Nearest point in the half-plane through the axis: a cylinder is a rectangle there.
Nearest nearest_on(double radius, double half, const Vector3d& p) {
  const double across = std::hypot(p.x(), p.y());
  const Vector3d way =
      across > 0 ? Vector3d(p.x() / across, p.y() / across, 0) : Vector3d(Vector3d::UnitX());
  const double r = std::min(across, radius), z = std::clamp(p.z(), -half, half);
  const double distance = std::hypot(across - r, p.z() - z);
  if (distance > 0)
    return {r * way + z * Vector3d::UnitZ(),
            (across - r) / distance * way + (p.z() - z) / distance * Vector3d::UnitZ(), distance};
  const double end = p.z() < 0 ? -1 : 1;
  if (radius - across < half - std::abs(p.z()))
    return {radius * way + z * Vector3d::UnitZ(), way, across - radius};
  return {{p.x(), p.y(), end * half}, end * Vector3d::UnitZ(), std::abs(p.z()) - half};
}

class CylinderForm final : public ShapeForm {
 public:
  CylinderForm() : ShapeForm(Family::curved, 4) {}
  void check(const Shape& s) const override {
    demand_positive(s, s.radius, "radius");
    demand_positive(s, s.length, "length");
  }
  double reach(const Shape& s) const override { return std::hypot(s.radius, 0.5 * s.length); }
  // Contacts are the lowest points of both rims and three more of the lower rim, so that a standing
  // cylinder has four. They turn with the tilt: the point over which it tips is always among them.
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    const Vector3d z = pose.rotation.col(2);
    const double along = z.dot(n);
    const Vector3d across = z.cross(z.cross(n));  // along z - n, without its cancellation
    const double tilt = across.norm();
    const Vector3d down =
        tilt > kUpright ? Vector3d(across / tilt) : Vector3d(pose.rotation.col(0));
    const Vector3d side = z.cross(down);
    const int lower = along < 0 ? 1 : 0;
    for (int end = 0; end < 2; ++end) {
      const Vector3d cap = pose.position + (end == 0 ? -0.5 : 0.5) * s.length * z;
      for (int k = 0; k < (end == lower ? 4 : 1); ++k) {
        const Vector3d way = k % 2 == 0 ? down : side;
        point_plane(cap + (k < 2 ? s.radius : -s.radius) * way, plane, n, margin, 4 * end + k, out);
      }
    }
  }
  Nearest nearest(const Shape& s, const Vector3d& p) const override {
    return nearest_on(s.radius, 0.5 * s.length, p);
  }
  bool has_nearest() const override { return true; }
  void begin(const Shape& s, ConvexShape& out) const override {
    out.half = Vector3d(s.radius, s.radius, 0.5 * s.length);
    out.thickness = out.half.minCoeff();
  }
  Vector3d farthest(const ConvexShape& s, const Vector3d& m, double less) const override {
    const double across = std::hypot(m.x(), m.y()), r = s.half.x() - less * s.thickness;
    Vector3d x = Vector3d::Zero();
    if (across > 0) x = Vector3d(r * m.x() / across, r * m.y() / across, 0);
    x.z() = signed_one(m.z()) * (s.half.z() - less * s.thickness);
    return x;
  }
  Eigen::Matrix3d curvature(const ConvexShape& s, const Vector3d& m) const override {
    const double across = std::hypot(m.x(), m.y());
    if (!(across > 1e-6)) return Eigen::Matrix3d::Zero();
    const Vector3d side(-m.y() / across, m.x() / across, 0);
    return s.half.x() / across * side * side.transpose();
  }
  Vector3d line(const ConvexShape& s, const Vector3d& m, double tolerance,
                Vector3d& face) const override {
    const Vector3d z = s.axis(2);
    const double along = z.dot(m);
    if (z.cross(m).norm() < tolerance) face = signed_one(along) * z;
    return std::abs(along) < tolerance ? z : Vector3d(Vector3d::Zero());
  }
  void flat(const ConvexShape& s, const Vector3d& m, double height, Flat& out) const override {
    const Vector3d z = s.axis(2);
    const double along = z.dot(m), end = signed_one(along), half = s.half.z(), r = s.half.x();
    const Vector3d across = z.cross(m).cross(z);  // m - along z
    const double tilt = across.norm();
    const Vector3d lowest = tilt > kUpright ? Vector3d(across / tilt) : s.axis(0);
    if (tilt < std::max(kFlatAngle, height / (2 * r))) {
      out.normal = end * z;
      const Vector3d other = out.normal.cross(lowest);
      for (int k = 0; k < kRim; ++k) {
        const double angle = 2 * linalg::kPi * k / kRim;
        out.add(
            s.origin + half * out.normal + r * (std::cos(angle) * lowest + std::sin(angle) * other),
            k);
      }
      return;
    }
    const Vector3d side = s.origin + r * lowest;
    if (std::abs(along) > std::max(kFlatAngle, height / (2 * half)))
      return out.add(side + end * half * z, end > 0 ? 2 * kRim + 1 : 2 * kRim);
    out.add(side - half * z, 2 * kRim);
    out.add(side + half * z, 2 * kRim + 1);
  }
};

}  // namespace

TETHER_SHAPE_FORM(cylinder, CylinderForm)

}  // namespace detail
}  // namespace tether::contact
