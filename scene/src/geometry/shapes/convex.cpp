// Tether: convex hulls of scenes. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/linalg/convex_hull.hpp>

#include "geometry/shape_type.hpp"

namespace tether::scene {
namespace {

using Eigen::Vector3d;

using Eigen::Matrix3d;

// Sums over tetrahedra with one corner at the origin: volume, first and second moments.
struct Moments {
  double volume = 0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();

  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const double v = a.dot(b.cross(c)) / 6;
    const Vector3d s = a + b + c;
    volume += v;
    first += v / 4 * s;
    second +=
        v / 20 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
  }
};

class ConvexType final : public ShapeType {
  std::vector<ShapeField> fields() const override {
    return {{"points", &Shape::points, "its corners [[x, y, z], ...], m", "", 4}};
  }
  MassProperties solid(const Shape& s) const override {
    const std::vector<Vector3d>& points = s.points;
    if (points.empty()) return {};
    Vector3d origin = Vector3d::Zero();
    for (const Vector3d& p : points) origin += p / static_cast<double>(points.size());
    std::vector<Vector3d> p;
    double size = 0;
    for (const Vector3d& each : points) {
      p.emplace_back(each - origin);
      size = std::max(size, p.back().norm());
    }
    if (!(size > 0) || !std::isfinite(size)) return {};
    for (Vector3d& each : p) each /= size;  // nothing below overflows

    Moments sum;
    for (const std::vector<std::size_t>& face : linalg::hull_faces(p))
      for (std::size_t m = 1; m + 1 < face.size(); ++m)
        sum.add(p[face[0]], p[face[m]], p[face[m + 1]]);
    if (!(sum.volume > 1e-12)) return {};
    MassProperties out;
    const double cube = size * size * size;
    const Vector3d centre = sum.first / sum.volume;
    const Matrix3d second = sum.second - sum.volume * centre * centre.transpose();
    out.volume = sum.volume * cube;
    out.centre = origin + centre * size;
    out.inertia = (second.trace() * Matrix3d::Identity() - second) * (cube * size * size);
    return out;
  }
  Mesh polygons(const Shape& s, int, double) const override { return points_mesh(s.points); }
  bool add_outline(const Shape& s, Outline& out) const override {
    add_corners(s, s.points, true, out);
    return true;
  }
};

}  // namespace

TETHER_SHAPE_TYPE(convex, ConvexType)

}  // namespace tether::scene
