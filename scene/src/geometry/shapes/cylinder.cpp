// Tether: cylinders of scenes. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

struct CylinderType : ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"radius", &Shape::radius, "m, > 0"},
            {"length", &Shape::length, "of the whole cylinder, m, > 0"}};
  }
  MassProperties solid(const Shape& s) const override {
    const double r = s.radius, L = s.length, volume = linalg::kPi * r * r * L,
                 across = volume * (r * r / 4 + L * L / 12);
    return {volume, Vector3d::Zero(), Vector3d(across, across, volume * r * r / 2).asDiagonal()};
  }
  Mesh polygons(const Shape& s, int around, double) const override {
    const auto n = static_cast<std::size_t>(around);
    Mesh m;
    m.faces.resize(2);  // lower and upper end
    for (const double z : {-s.length / 2, s.length / 2})
      for (int k = 0; k < around; ++k) {
        const double angle = 2 * linalg::kPi * k / around;
        m.points.emplace_back(s.radius * std::cos(angle), s.radius * std::sin(angle), z);
      }
    for (std::size_t k = 0; k < n; ++k) {
      m.faces[0].push_back(n - 1 - k);
      m.faces[1].push_back(n + k);
      m.faces.push_back({k, (k + 1) % n, n + (k + 1) % n, n + k});
    }
    return m;
  }
  bool add_outline(const Shape& s, Outline& out) const override {
    add_axis(s, out);
    for (const double side : {-1.0, 1.0}) {
      Round disc;
      disc.at = placed(s, {0, 0, 0.5 * side * s.length});
      disc.shape = s.orientation.toRotationMatrix() * Vector3d(s.radius, s.radius, 0).asDiagonal();
      disc.outward = s.orientation * Vector3d(0, 0, side);
      out.rounds.push_back(disc);
      out.ends.push_back({{disc.at, disc.outward, {}}, s.radius});
    }
    return true;
  }
};

TETHER_SHAPE_TYPE(cylinder, CylinderType)

}  // namespace tether::scene
