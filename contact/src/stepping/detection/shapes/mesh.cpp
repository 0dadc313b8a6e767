// Tether: surfaces of triangles. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <tether/linalg/index.hpp>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::mesh(std::vector<Vector3d> vertices, std::vector<std::array<int, 3>> triangles) {
  Shape s;
  s.kind = ShapeKind::mesh;
  s.points = std::move(vertices);
  s.triangles = std::move(triangles);
  return s;
}

Shape Shape::height_field(const std::vector<double>& heights, int nx, double dx, double dy) {
  const int ny = nx > 0 ? static_cast<int>(heights.size()) / nx : 0;
  if (nx < 2 || ny < 2 || heights.size() != linalg::at(nx) * linalg::at(ny))
    throw std::invalid_argument("height_field: needs at least 2 x 2 heights, rows of nx");
  Shape s;
  s.kind = ShapeKind::mesh;
  for (int k = 0; k < ny; ++k)
    for (int i = 0; i < nx; ++i)
      s.points.emplace_back(i * dx, k * dy, heights[linalg::at(k * nx + i)]);
  for (int k = 0; k + 1 < ny; ++k)
    for (int i = 0; i + 1 < nx; ++i) {
      const int p = k * nx + i;
      s.triangles.push_back({p, p + 1, p + nx + 1});
      s.triangles.push_back({p, p + nx + 1, p + nx});
    }
  return s;
}

namespace detail {
namespace {

constexpr std::size_t kMostTriangles = 2000000;

class MeshForm final : public ShapeForm {
 public:
  MeshForm() : ShapeForm(Family::mesh, 8) {}
  void check(const Shape& s) const override {
    const int count = static_cast<int>(s.points.size());
    if (count < 3 || s.triangles.empty() || s.points.size() > kMostTriangles ||
        s.triangles.size() > kMostTriangles)
      throw std::invalid_argument("mesh: needs 3 to " + std::to_string(kMostTriangles) +
                                  " points and 1 to as many triangles");
    for (const Vector3d& p : s.points)
      if (!p.allFinite() || !(p.cwiseAbs().maxCoeff() < 1e100))
        throw std::invalid_argument("mesh: points must be finite, below 1e100 m");
    for (const std::array<int, 3>& t : s.triangles)
      for (const int k : t)
        if (k < 0 || k >= count)
          throw std::invalid_argument("mesh: a triangle names point " + std::to_string(k) + " of " +
                                      std::to_string(count));
    const auto flat = [&](const std::array<int, 3>& t) {
      const Vector3d& a = s.points[linalg::at(t[0])];
      return !((s.points[linalg::at(t[1])] - a).cross(s.points[linalg::at(t[2])] - a).stableNorm() >
               0);
    };
    if (std::all_of(s.triangles.begin(), s.triangles.end(), flat))
      throw std::invalid_argument("mesh: none of the triangles has an area");
  }
  double reach(const Shape& s) const override { return reach_of_points(s); }
};

}  // namespace

TETHER_SHAPE_FORM(mesh, MeshForm)

}  // namespace detail
}  // namespace tether::contact
