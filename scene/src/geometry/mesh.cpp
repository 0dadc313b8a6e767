// Tether: shapes as polygons, for files and pictures. SPDX-License-Identifier: BSD-3-Clause
#include "mesh.hpp"

#include <cmath>
#include <numeric>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/pi.hpp>

namespace tether::scene {

namespace {

using Eigen::Vector3d;

Mesh box_mesh(const Vector3d& size) {
  Mesh m;
  for (int corner = 0; corner < 8; ++corner)
    m.points.emplace_back(
        Vector3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1).cwiseProduct(size) /
        2);
  m.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  return m;
}

// Two half spheres, `length` apart along z; a sphere at length 0.
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

Mesh ellipsoid_mesh(const Vector3d& half_axes, int around) {
  Mesh m = capsule_mesh(1, 0, around);
  for (Vector3d& p : m.points) p = p.cwiseProduct(half_axes);
  return m;
}

Mesh cylinder_mesh(double radius, double length, int around) {
  const auto n = static_cast<std::size_t>(around);
  Mesh m;
  m.faces.resize(2);  // lower and upper end
  for (const double z : {-length / 2, length / 2})
    for (int k = 0; k < around; ++k) {
      const double angle = 2 * linalg::kPi * k / around;
      m.points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
  for (std::size_t k = 0; k < n; ++k) {
    m.faces[0].push_back(n - 1 - k);
    m.faces[1].push_back(n + k);
    m.faces.push_back({k, (k + 1) % n, n + (k + 1) % n, n + k});
  }
  return m;
}

Mesh plane(const Vector3d& normal, double half) {
  const Vector3d other = std::abs(normal.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
  const Vector3d v = normal.cross(other).normalized() * half, u = v.cross(normal);
  return {{-u - v, u - v, u + v, -u + v}, {{0, 1, 2, 3}}, {}};
}

Mesh points(const std::vector<Vector3d>& all) {
  Mesh m{all, linalg::hull_faces(all), {}};
  if (!m.faces.empty()) return m;
  m.single.resize(all.size());
  std::iota(m.single.begin(), m.single.end(), std::size_t{0});
  return m;
}

Mesh surface(const Shape& shape) {
  Mesh m{shape.points, {}, {}};
  for (const std::array<int, 3>& t : shape.triangles)
    m.faces.push_back({static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]),
                       static_cast<std::size_t>(t[2])});
  return m;
}

Mesh in_own_axes(const Shape& shape, int around, double half_plane) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      return capsule_mesh(shape.radius, 0, around);
    case ShapeKind::capsule:
      return capsule_mesh(shape.radius, shape.length, around);
    case ShapeKind::ellipsoid:
      return ellipsoid_mesh(shape.size, around);
    case ShapeKind::cylinder:
      return cylinder_mesh(shape.radius, shape.length, around);
    case ShapeKind::box:
      return box_mesh(shape.size);
    case ShapeKind::plane:
      return plane(shape.normal, half_plane);
    case ShapeKind::convex:
    case ShapeKind::points:
      return points(shape.points);
    case ShapeKind::mesh:
      return surface(shape);
  }
  return {};
}

}  // namespace

Mesh mesh(const Shape& shape, int around, double half_plane) {
  Mesh m = in_own_axes(shape, around, half_plane);
  for (Vector3d& p : m.points) p = shape.position + shape.orientation * p;
  return m;
}

}  // namespace tether::scene
