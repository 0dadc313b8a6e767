// Tether: surfaces of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

struct MeshType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"points", &Shape::points, ""}, {"triangles", &Shape::triangles, ""}};
  }
  void read(files::Fields& in, files::Reader& r, Shape& shape) const override {
    files::read_mesh(in, r, shape);
  }
  MassProperties solid(const Shape& s) const override {
    return within(s.points, polygons(s, 0, 0).faces);
  }
  Mesh polygons(const Shape& s, int, double) const override {
    Mesh m{s.points, {}, {}};
    for (const std::array<int, 3>& t : s.triangles)
      m.faces.push_back({static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]),
                         static_cast<std::size_t>(t[2])});
    return m;
  }
};

TETHER_SHAPE_TYPE(mesh, MeshType)

}  // namespace tether::scene
