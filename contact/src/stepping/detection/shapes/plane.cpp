// Tether: planes. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::plane(const Vector3d& normal) {
  Shape s;
  s.kind = ShapeKind::plane;
  s.normal = normal.normalized();
  return s;
}

namespace detail {
namespace {

class PlaneForm final : public ShapeForm {
 public:
  PlaneForm() : ShapeForm(Family::plane, 7) {}
  void check(const Shape& s) const override {
    if (!(std::abs(s.normal.norm() - 1) < 1e-6))
      throw std::invalid_argument("plane: normal must be a unit vector");
  }
  double reach(const Shape&) const override { return std::numeric_limits<double>::infinity(); }
};

}  // namespace

TETHER_SHAPE_FORM(plane, PlaneForm)

}  // namespace detail
}  // namespace tether::contact
