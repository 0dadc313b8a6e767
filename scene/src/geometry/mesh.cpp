// Tether: shapes as polygons, for files and pictures. SPDX-License-Identifier: BSD-3-Clause
#include "mesh.hpp"

#include <cmath>
#include <numeric>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/pi.hpp>

#include "bounds.hpp"
#include "shape_type.hpp"

namespace tether::scene {

using Eigen::Vector3d;

Mesh capsule_mesh(double radius, double length, int around) {
  const int rings = std::max(2, around / 4);  // of each half, pole excluded
  const auto n = static_cast<std::size_t>(around);
  Mesh m;
  m.points.emplace_back(0, 0, -length / 2 - radius);
  for (int ring = 0; ring < 2 * rings; ++ring) {
    const bool upper = ring >= rings;
    const double latitude = upper ? linalg::kPi / 2 * (ring - rings) / rings
                                  : linalg::kPi / 2 * (ring + 1 - rings) / rings;
    for (int k = 0; k < around; ++k) {
      const double longitude = 2 * linalg::kPi * k / around;
      m.points.emplace_back(radius * std::cos(latitude) * std::cos(longitude),
                            radius * std::cos(latitude) * std::sin(longitude),
                            radius * std::sin(latitude) + (upper ? length / 2 : -length / 2));
    }
  }
  m.points.emplace_back(0, 0, length / 2 + radius);
  const std::size_t last = m.points.size() - 1;
  const auto at = [&](int ring, std::size_t k) {
    return 1 + static_cast<std::size_t>(ring) * n + k % n;
  };
  for (std::size_t k = 0; k < n; ++k) {
    m.faces.push_back({0, at(0, k + 1), at(0, k)});
    for (int ring = 0; ring + 1 < 2 * rings; ++ring) {
      if (ring + 1 == rings && length == 0) continue;  // both are the equator
      m.faces.push_back({at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)});
    }
    m.faces.push_back({last, at(2 * rings - 1, k), at(2 * rings - 1, k + 1)});
  }
  return m;
}

Mesh points_mesh(const std::vector<Vector3d>& all) {
  Mesh m{all, linalg::hull_faces(all), {}};
  if (!m.faces.empty()) return m;
  m.single.resize(all.size());
  std::iota(m.single.begin(), m.single.end(), std::size_t{0});
  return m;
}

Mesh mesh(const Shape& shape, int around, double half_plane) {
  Mesh m = type_of(shape.kind).polygons(shape, around, half_plane);
  for (Vector3d& p : m.points) p = shape.position + shape.orientation * p;
  return m;
}

double reach_of(const Body& body) {
  double reach = 0;
  for (const Shape& shape : body.shapes) {
    if (shape.kind == ShapeKind::plane) return kInfinity;
    for (const Vector3d& p : mesh(shape, 8, 0).points) reach = std::max(reach, p.norm());
  }
  return reach;
}

}  // namespace tether::scene
