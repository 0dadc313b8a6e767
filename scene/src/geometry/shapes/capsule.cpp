// Tether: capsules of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

struct CapsuleType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"radius", &Shape::radius, "m, > 0"},
            {"length", &Shape::length, "between the centres of the caps, m, > 0"}};
  }
  // Cylinder of length L and two half spheres, axis z.
  MassProperties solid(const Shape& s) const override {
    const double r = s.radius, L = s.length;
    const double cylinder = linalg::kPi * r * r * L, caps = 4.0 / 3.0 * linalg::kPi * r * r * r;
    const double along = cylinder * r * r / 2 + caps * 0.4 * r * r;
    const double across =
        cylinder * (r * r / 4 + L * L / 12) + caps * (0.4 * r * r + L * L / 4 + 3.0 / 8.0 * L * r);
    return {cylinder + caps, Vector3d::Zero(), Vector3d(across, across, along).asDiagonal()};
  }

  Mesh polygons(const Shape& s, int around, double) const override {
    return capsule_mesh(s.radius, s.length, around);
  }
  bool add_outline(const Shape& s, Outline& out) const override {
    for (const double end : {-0.5, 0.5})
      out.knobs.push_back({placed(s, {0, 0, end * s.length}), s.radius, {}});
    add_axis(s, out);
    return true;
  }
  bool is_round() const override { return true; }
};

TETHER_SHAPE_TYPE(capsule, CapsuleType)

}  // namespace tether::scene
