// Tether: spheres of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

struct SphereType : ShapeType {
  std::vector<ShapeField> fields() const override { return {{"radius", &Shape::radius, "m, > 0"}}; }
  MassProperties solid(const Shape& s) const override {
    const double r = s.radius, volume = 4.0 / 3.0 * linalg::kPi * r * r * r;
    return {volume, Vector3d::Zero(), 0.4 * volume * r * r * Eigen::Matrix3d::Identity()};
  }
  Mesh polygons(const Shape& s, int around, double) const override {
    return capsule_mesh(s.radius, 0, around);
  }
  bool add_outline(const Shape& s, Outline& out) const override {
    out.knobs.push_back({s.position, s.radius, {}});
    return true;
  }
  bool is_round() const override { return true; }
  std::optional<Vector3d> make_unit(Shape& s) const override {
    const double size = std::exchange(s.radius, 1);
    return Vector3d::Constant(size);
  }
};

TETHER_SHAPE_TYPE(sphere, SphereType)

}  // namespace tether::scene
