// Tether: convex hulls of points. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/pi.hpp>

#include "support/catch.hpp"

using Eigen::Quaterniond;
using Eigen::Vector3d;
using tether::linalg::hull_faces;

namespace {

std::mt19937 random_numbers(5);

double part() { return std::uniform_real_distribution<double>(-1, 1)(random_numbers); }

std::vector<Vector3d> box() {
  std::vector<Vector3d> out;
  for (int k = 0; k < 8; ++k)
    out.emplace_back((k & 1) != 0 ? 1 : -1, (k & 2) != 0 ? 0.5 : -0.5, (k & 4) != 0 ? 0.1 : -0.1);
  return out;
}

std::vector<Vector3d> prism(int sides) {
  std::vector<Vector3d> out;
  for (int k = 0; k < sides; ++k)
    for (const double z : {-0.3, 0.3})
      out.emplace_back(std::cos(2 * tether::linalg::kPi * k / sides),
                       std::sin(2 * tether::linalg::kPi * k / sides), z);
  return out;
}

std::vector<Vector3d> on_sphere(int count) {
  std::vector<Vector3d> out;
  for (int k = 0; k < count; ++k) out.push_back(Vector3d(part(), part(), part()).normalized());
  return out;
}

// Euler's formula, every edge in two faces of opposite sense, all points below every face.
void check(std::vector<Vector3d> points, std::size_t faces, std::size_t corners) {
  const Quaterniond turn = Quaterniond(part(), part(), part(), part()).normalized();
  const double size = std::pow(10, 3 * part());
  const Vector3d at = 10 * size * Vector3d(part(), part(), part());
  for (Vector3d& p : points) p = at + size * (turn * p);
  std::shuffle(points.begin(), points.end(), random_numbers);
  const auto found = hull_faces(points);
  std::map<std::pair<std::size_t, std::size_t>, int> edges;
  std::set<std::size_t> vertices;
  double above = 0;
  for (const auto& loop : found) {
    Vector3d area = Vector3d::Zero();
    for (std::size_t k = 0; k < loop.size(); ++k) {
      vertices.insert(loop[k]);
      ++edges[{loop[k], loop[(k + 1) % loop.size()]}];
      area += (points[loop[k]] - points[loop[0]])
                  .cross(points[loop[(k + 1) % loop.size()]] - points[loop[0]]);
    }
    for (const Vector3d& p : points)
      above = std::max(above, area.normalized().dot(p - points[loop[0]]));
  }
  CHECK(found.size() == faces);
  CHECK(vertices.size() == corners);
  for (const auto& [edge, count] : edges) {
    CHECK(count == 1);
    CHECK(edges.count({edge.second, edge.first}) == 1);
  }
  CHECK(vertices.size() + found.size() == edges.size() / 2 + 2);
  CHECK(above < 1e-13 * size);
}

}  // namespace

TEST_CASE("a hull is closed and has the faces of boxes, prisms and points on a sphere") {
  for (int k = 0; k < 50; ++k) {
    check(box(), 6, 8);
    check(prism(3 + k), static_cast<std::size_t>(5 + k), static_cast<std::size_t>(2 * (3 + k)));
    check(on_sphere(4 + 3 * k), static_cast<std::size_t>(2 * (4 + 3 * k) - 4),
          static_cast<std::size_t>(4 + 3 * k));
  }
}

TEST_CASE("points inside a hull, in its faces, on its edges and at its corners change nothing") {
  for (int k = 0; k < 50; ++k) {
    std::vector<Vector3d> points = box();
    for (int i = 0; i < 8; ++i) {
      points.push_back(points[static_cast<std::size_t>(i)]);
      points.push_back(0.7 * points[static_cast<std::size_t>(i)]);
      const Vector3d& p = points[static_cast<std::size_t>(i)];
      points.emplace_back(0.3 * p.x(), p.y(), p.z());
      points.emplace_back(0.3 * p.x(), 0.2 * p.y(), p.z());
    }
    check(points, 6, 8);
  }
}

TEST_CASE("points in a plane, on a line, at one place, few or without bounds have no hull") {
  std::vector<Vector3d> flat, line, same(9, Vector3d(1, 2, 3));
  for (int k = 0; k < 20; ++k) {
    flat.emplace_back(part(), 3 * part(), 0);
    flat.back().z() = 0.3 * flat.back().x() - flat.back().y();
    line.push_back(part() * Vector3d(1, 2, 3));
  }
  CHECK(hull_faces(flat).empty());
  CHECK(hull_faces(line).empty());
  CHECK(hull_faces(same).empty());
  CHECK(hull_faces({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}).empty());
  CHECK(hull_faces({}).empty());
  std::vector<Vector3d> bad = box();
  bad[3].x() = INFINITY;
  CHECK(hull_faces(bad).empty());
  bad[3].x() = NAN;
  CHECK(hull_faces(bad).empty());
}
