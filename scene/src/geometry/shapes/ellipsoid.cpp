// Tether: ellipsoids of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

struct EllipsoidType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"half_axes", &Shape::size, "[x, y, z], m, > 0"}};
  }
  MassProperties solid(const Shape& s) const override {
    return along_axes(4.0 / 3.0 * linalg::kPi * s.size.prod(), s.size, 5);
  }
  Mesh polygons(const Shape& s, int around, double) const override {
    Mesh m = capsule_mesh(1, 0, around);
    for (Vector3d& p : m.points) p = p.cwiseProduct(s.size);
    return m;
  }
  bool add_outline(const Shape& s, Outline& out) const override {
    Round round;
    round.at = s.position;
    round.shape = s.orientation.toRotationMatrix() * s.size.asDiagonal();
    out.rounds.push_back(round);
    return true;
  }
  bool is_round() const override { return true; }
};

TETHER_SHAPE_TYPE(ellipsoid, EllipsoidType)

}  // namespace tether::scene
