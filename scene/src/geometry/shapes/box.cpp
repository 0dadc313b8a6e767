// Tether: boxes of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

struct BoxType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"size", &Shape::size, "the full edges [x, y, z], m, > 0", "m (full edges)"}};
  }
  MassProperties solid(const Shape& s) const override {
    return along_axes(s.size.prod(), s.size, 12);
  }
  Mesh polygons(const Shape& s, int, double) const override {
    Mesh m;
    for (int corner = 0; corner < 8; ++corner)
      m.points.emplace_back(Vector3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1)
                                .cwiseProduct(s.size) /
                            2);
    m.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    return m;
  }
  bool add_outline(const Shape& s, Outline& out) const override {
    add_corners(s, polygons(s, 0, 0).points, true, out);
    return true;
  }
  std::optional<Vector3d> make_unit(Shape& s) const override {
    return std::exchange(s.size, Vector3d::Ones());
  }
};

TETHER_SHAPE_TYPE(box, BoxType)

}  // namespace tether::scene
