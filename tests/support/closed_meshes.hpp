// Closed surfaces of triangles for tests. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <vector>

namespace closed_meshes {

struct Surface {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;

  void quad(int a, int b, int c, int d) {
    triangles.push_back({a, b, c});
    triangles.push_back({a, c, d});
  }
};

/// The surface of those cells of a grid that are filled.
inline Surface of_cells(const std::array<std::vector<double>, 3>& lines,
                        const std::function<bool(int, int, int)>& filled) {
  Surface out;
  std::map<std::array<int, 3>, int> known;
  const auto point = [&](const std::array<int, 3>& at) {
    const auto [place, fresh] = known.emplace(at, static_cast<int>(out.points.size()));
    if (fresh) {
      Eigen::Vector3d p;
      for (std::size_t k = 0; k < 3; ++k)
        p[static_cast<Eigen::Index>(k)] = lines[k][static_cast<std::size_t>(at[k])];
      out.points.push_back(p);
    }
    return place->second;
  };
  std::array<int, 3> count{};
  for (std::size_t k = 0; k < 3; ++k) count[k] = static_cast<int>(lines[k].size()) - 1;
  const auto is_filled = [&](const std::array<int, 3>& c) {
    for (std::size_t k = 0; k < 3; ++k)
      if (c[k] < 0 || c[k] >= count[k]) return false;
    return filled(c[0], c[1], c[2]);
  };
  for (int x = 0; x < count[0]; ++x)
    for (int y = 0; y < count[1]; ++y)
      for (int z = 0; z < count[2]; ++z)
        for (std::size_t axis = 0; axis < 3; ++axis)
          for (const int side : {0, 1}) {
            std::array<int, 3> cell{x, y, z}, next = cell;
            next[axis] += side == 0 ? -1 : 1;
            if (!is_filled(cell) || is_filled(next)) continue;
            const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
            std::array<int, 4> corner{};
            for (std::size_t k = 0; k < 4; ++k) {
              std::array<int, 3> at = cell;
              at[axis] += side;
              at[u] += k == 1 || k == 2 ? 1 : 0;
              at[v] += k >= 2 ? 1 : 0;
              corner[k] = point(at);
            }
            if (side == 0) std::swap(corner[1], corner[3]);
            out.quad(corner[0], corner[1], corner[2], corner[3]);
          }
  return out;
}

/// A ring about z: sectors of a section that is a polygon [radius, height], counterclockwise where
/// the radius points to the right and the height upwards.
inline Surface ring(int sectors, const std::vector<Eigen::Vector2d>& section) {
  Surface out;
  const int n = static_cast<int>(section.size());
  for (int s = 0; s < sectors; ++s) {
    const double angle = 2 * 3.14159265358979323846 * s / sectors;
    for (const Eigen::Vector2d& p : section)
      out.points.emplace_back(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y());
  }
  for (int s = 0; s < sectors; ++s)
    for (int k = 0; k < n; ++k) {
      const int a = s * n + k, b = s * n + (k + 1) % n, c = (s + 1) % sectors * n;
      out.quad(a, c + k, c + (k + 1) % n, b);
    }
  return out;
}

}  // namespace closed_meshes
