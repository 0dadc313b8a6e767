// Tether: spheres. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::sphere(double radius) {
  Shape s;
  s.kind = ShapeKind::sphere;
  s.radius = radius;
  return s;
}

namespace detail {
namespace {

class SphereForm final : public ShapeForm {
 public:
  SphereForm() : ShapeForm(Family::ball, 0) {}
  void check(const Shape& s) const override { demand_positive(s, s.radius, "radius"); }
  double reach(const Shape& s) const override { return s.radius; }
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    ball_plane(pose.position, s.radius, plane, n, margin, 0, out);
  }
  Nearest nearest(const Shape& s, const Vector3d& p) const override {
    return on_ball(Vector3d::Zero(), s.radius, p, Vector3d::UnitZ());
  }
  bool has_nearest() const override { return true; }
  void begin(const Shape& s, ConvexShape& out) const override {
    out.rotation.setIdentity();
    out.round = out.thickness = s.radius;
  }
};

}  // namespace

TETHER_SHAPE_FORM(sphere, SphereForm)

}  // namespace detail
}  // namespace tether::contact
