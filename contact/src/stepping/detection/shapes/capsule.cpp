// Tether: capsules. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::capsule(double radius, double length) {
  Shape s;
  s.kind = ShapeKind::capsule;
  s.radius = radius;
  s.length = length;
  return s;
}

namespace detail {
namespace {

class CapsuleForm final : public ShapeForm {
 public:
  CapsuleForm() : ShapeForm(Family::ball, 1) {}
  void check(const Shape& s) const override {
    demand_positive(s, s.radius, "radius");
    if (s.length != 0) demand_positive(s, s.length, "length");
  }
  double reach(const Shape& s) const override { return s.radius + 0.5 * s.length; }
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    for (int end = 0; end < 2; ++end)
      ball_plane(pose.position + (end == 0 ? -0.5 : 0.5) * s.length * pose.rotation.col(2),
                 s.radius, plane, n, margin, end, out);
  }
  Nearest nearest(const Shape& s, const Vector3d& p) const override {
    const Vector3d foot(0, 0, std::clamp(p.z(), -0.5 * s.length, 0.5 * s.length));
    return on_ball(foot, s.radius, p, Vector3d::UnitX());
  }
  bool has_nearest() const override { return true; }
  void begin(const Shape& s, ConvexShape& out) const override {
    out.half.z() = 0.5 * s.length;
    out.round = out.thickness = s.radius;
  }
  Vector3d farthest(const ConvexShape& s, const Vector3d& m, double) const override {
    return {0, 0, signed_one(m.z()) * s.half.z()};
  }
  Vector3d line(const ConvexShape& s, const Vector3d& m, double tolerance,
                Vector3d&) const override {
    const Vector3d z = s.axis(2);
    return std::abs(z.dot(m)) < tolerance && s.half.z() > 0 ? z : Vector3d(Vector3d::Zero());
  }
  void flat(const ConvexShape& s, const Vector3d& m, double height, Flat& out) const override {
    const Vector3d z = s.axis(2);
    const double along = z.dot(m), end = signed_one(along), half = s.half.z();
    if (std::abs(along) > std::max(kFlatAngle, height / (2 * half)) || half == 0)
      return out.add(s.origin + end * half * z, end > 0 ? 1 : 0);
    out.add(s.origin - half * z, 0);
    out.add(s.origin + half * z, 1);
  }
};

}  // namespace

TETHER_SHAPE_FORM(capsule, CapsuleForm)

}  // namespace detail
}  // namespace tether::contact
