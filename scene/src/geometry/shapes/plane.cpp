// Tether: planes of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

struct PlaneType : ShapeType {
  std::vector<ShapeField> fields() const override { return {{"normal", &Shape::normal, nullptr}}; }
  Mesh polygons(const Shape& s, int, double half) const override {
    const Vector3d other = std::abs(s.normal.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
    const Vector3d v = s.normal.cross(other).normalized() * half, u = v.cross(s.normal);
    return {{-u - v, u - v, u + v, -u + v}, {{0, 1, 2, 3}}, {}};
  }
  bool add_outline(const Shape& s, Outline& out) const override {
    out.faces.push_back({s.position, s.orientation * s.normal, {}});
    return true;
  }
};

TETHER_SHAPE_TYPE(plane, PlaneType)

}  // namespace tether::scene
