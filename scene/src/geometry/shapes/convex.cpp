// Tether: convex hulls of scenes. SPDX-License-Identifier: BSD-3-Clause
#include <tether/linalg/convex_hull.hpp>

#include "geometry/shape_type.hpp"

namespace tether::scene {

struct ConvexType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"points", &Shape::points, "its corners [[x, y, z], ...], m", "", 4}};
  }
  MassProperties solid(const Shape& s) const override {
    return s.points.empty() ? MassProperties() : within(s.points, linalg::hull_faces(s.points));
  }
  Mesh polygons(const Shape& s, int, double) const override { return points_mesh(s.points); }
  bool add_outline(const Shape& s, Outline& out) const override {
    add_corners(s, s.points, true, out);
    return true;
  }
};

TETHER_SHAPE_TYPE(convex, ConvexType)

}  // namespace tether::scene
