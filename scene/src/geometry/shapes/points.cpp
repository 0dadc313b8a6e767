// Tether: points that touch of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

struct PointsType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"points", &Shape::points, "the points that touch [[x, y, z], ...], m", "", 1}};
  }
  Mesh polygons(const Shape& s, int, double) const override { return points_mesh(s.points); }
  bool add_outline(const Shape& s, Outline& out) const override {
    add_corners(s, s.points, false, out);
    return true;
  }
};

TETHER_SHAPE_TYPE(points, PointsType)

}  // namespace tether::scene
