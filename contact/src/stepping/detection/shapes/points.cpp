// Tether: points that touch. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::touching_points(std::vector<Vector3d> points) {
  Shape s;
  s.kind = ShapeKind::points;
  s.points = std::move(points);
  return s;
}

namespace detail {
namespace {

class PointsForm final : public ShapeForm {
 public:
  PointsForm() : ShapeForm(Family::points, 6) {}
  void check(const Shape& s) const override { check_points(s, 1); }
  double reach(const Shape& s) const override { return reach_of_points(s); }
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    points_on_plane(s, pose, plane, n, margin, out);
  }
};

}  // namespace

TETHER_SHAPE_FORM(points, PointsForm)

}  // namespace detail
}  // namespace tether::contact
