// Closed meshes as convex parts: volumes, supports, seams. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <random>
#include <set>
#include <tether/linalg/convex_hull.hpp>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"
#include "support/closed_meshes.hpp"

namespace {

using namespace stepping_scenes;
using closed_meshes::Surface;
using tc::Shape;

Shape shape_of(const Surface& s) { return Shape::mesh(s.points, s.triangles); }

double volume(const Shape& part) {
  double six = 0;
  for (const auto& face : tether::linalg::hull_faces(part.points))
    for (std::size_t k = 1; k + 1 < face.size(); ++k)
      six += part.points[face[0]].dot(part.points[face[k]].cross(part.points[face[k + 1]]));
  return six / 6;
}
double volume(const std::vector<Shape>& parts) {
  double sum = 0;
  for (const Shape& each : parts) sum += volume(each);
  return sum;
}
double support(const std::vector<Shape>& parts, const Vector3d& m) {
  double most = -1e300;
  for (const Shape& s : parts)
    for (const Vector3d& p : s.points) most = std::max(most, m.dot(s.position + s.orientation * p));
  return most;
}
bool contains(const Shape& part, const Vector3d& x) {
  const Vector3d p = part.orientation.conjugate() * (x - part.position);
  for (const auto& face : tether::linalg::hull_faces(part.points)) {
    const Vector3d &a = part.points[face[0]], &b = part.points[face[1]], &c = part.points[face[2]];
    if ((b - a).cross(c - a).dot(p - a) > 0) return false;
  }
  return true;
}

std::string error_of(const Shape& mesh) {
  try {
    tc::convex_parts(mesh);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}
void check_error(const Shape& mesh, const std::string& text) {
  const std::string error = error_of(mesh);
  INFO(error);
  CHECK(error.find(text) != std::string::npos);
}

std::array<std::vector<double>, 3> cuts(const std::vector<double>& x, const std::vector<double>& y,
                                        const std::vector<double>& z) {
  return {x, y, z};
}
// An L: x from 0 to 3, 1 high where x > 1, else 2 high; 1 wide.
Surface angle() {
  return closed_meshes::of_cells(cuts({0, 1, 3}, {0, 1}, {0, 1, 2}),
                                 [](int x, int, int z) { return x == 0 || z == 0; });
}
// A top of 6 x 4 x 1 on four legs of 1 x 1 x 3.
Surface table() {
  return closed_meshes::of_cells(cuts({0, 1, 5, 6}, {0, 1, 3, 4}, {0, 3, 4}),
                                 [](int x, int y, int z) { return z == 1 || (x != 1 && y != 1); });
}
Surface cube() {
  return closed_meshes::of_cells(cuts({-0.3, 0.5}, {0, 1}, {0, 1}),
                                 [](int, int, int) { return true; });
}

}  // namespace

TEST_CASE("parts: unions of boxes keep their volume, their points and their supports",
          "[stepping]") {
  std::mt19937 g(20261129);
  std::uniform_real_distribution<double> step(0.1, 1);
  std::uniform_int_distribution<int> cell(0, 3);
  std::normal_distribution<double> normal;
  int solids = 0;
  std::size_t most = 0;
  for (int trial = 0; trial < 60; ++trial) {
    std::array<std::vector<double>, 3> lines;
    for (std::vector<double>& axis : lines) {
      axis = {0};
      for (int k = 0; k < 4; ++k) axis.push_back(axis.back() + step(g));
    }
    bool filled[4][4][4] = {};
    for (int box = 0; box < 3; ++box) {
      std::array<int, 3> low{}, high{};
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = cell(g), high[k] = cell(g);
        if (low[k] > high[k]) std::swap(low[k], high[k]);
      }
      for (int x = low[0]; x <= high[0]; ++x)
        for (int y = low[1]; y <= high[1]; ++y)
          for (int z = low[2]; z <= high[2]; ++z) filled[x][y][z] = true;
    }
    Surface s =
        closed_meshes::of_cells(lines, [&](int x, int y, int z) { return filled[x][y][z]; });
    const Quaterniond turn(
        Eigen::Vector4d(normal(g), normal(g), normal(g), normal(g)).normalized());
    const double scale = std::pow(10.0, 3 * normal(g));
    for (Vector3d& p : s.points) p = scale * (turn * p);
    INFO("trial " << trial);
    // Boxes that have an edge alone in common bound no solid by pairs of triangles.
    const std::string error = error_of(shape_of(s));
    if (!error.empty()) {
      CHECK(error.find("in the same direction") != std::string::npos);
      continue;
    }
    ++solids;
    const std::vector<Shape> parts = tc::convex_parts(shape_of(s));
    most = std::max(most, parts.size());
    double exact = 0;
    for (int x = 0; x < 4; ++x)
      for (int y = 0; y < 4; ++y)
        for (int z = 0; z < 4; ++z) {
          const auto at = [](int k) { return static_cast<std::size_t>(k); };
          Vector3d low(lines[0][at(x)], lines[1][at(y)], lines[2][at(z)]);
          Vector3d high(lines[0][at(x + 1)], lines[1][at(y + 1)], lines[2][at(z + 1)]);
          if (filled[x][y][z]) exact += (high - low).prod() * std::pow(scale, 3);
          const Vector3d middle = scale * (turn * ((low + high) / 2));
          CHECK(std::count_if(parts.begin(), parts.end(), [&](const Shape& each) {
                  return contains(each, middle);
                }) == (filled[x][y][z] ? 1 : 0));
        }
    CHECK(volume(parts) == Approx(exact).epsilon(1e-13));
    for (int k = 0; k < 20; ++k) {
      const Vector3d m = Vector3d(normal(g), normal(g), normal(g)).normalized();
      double whole = -1e300;
      for (const Vector3d& p : s.points) whole = std::max(whole, m.dot(p));
      CHECK(std::abs(support(parts, m) - whole) < 1e-13 * scale);
    }
  }
  CHECK(solids > 40);
  CHECK(most <= 12);
}

TEST_CASE("parts: an angle has two, a table five, a ring one each sector", "[stepping]") {
  CHECK(tc::convex_parts(shape_of(angle())).size() == 2);
  CHECK(tc::convex_parts(shape_of(table())).size() == 5);
  std::vector<Eigen::Vector2d> section;
  for (int k = 0; k < 8; ++k)
    section.emplace_back(1 + 0.3 * std::cos(k * kPi / 4), 0.3 * std::sin(k * kPi / 4));
  const std::vector<Shape> ring = tc::convex_parts(shape_of(closed_meshes::ring(12, section)));
  CHECK(ring.size() == 12);
  // A sector joins equal points of two sections by chords, r sin(angle) dr dz dt.
  const double area = 4 * std::sin(kPi / 4) * 0.09;
  CHECK(volume(ring) == Approx(12 * std::sin(kPi / 6) * area).epsilon(1e-12));
}

TEST_CASE("parts: hollows up to the concavity are filled, and no deeper ones", "[stepping]") {
  // A cube with a groove along y, 0.1 deep.
  const Surface s = closed_meshes::of_cells(cuts({0, 0.4, 0.6, 1}, {0, 1}, {0, 0.9, 1}),
                                            [](int x, int, int z) { return x != 1 || z == 0; });
  Shape mesh = shape_of(s);
  CHECK(tc::convex_parts(mesh).size() == 3);
  CHECK(volume(tc::convex_parts(mesh)) == Approx(0.98).epsilon(1e-14));
  mesh.concavity = 0.099;
  CHECK(tc::convex_parts(mesh).size() == 3);
  mesh.concavity = 0.6;
  REQUIRE(tc::convex_parts(mesh).size() == 1);
  CHECK(volume(tc::convex_parts(mesh)) == Approx(1).epsilon(1e-14));
  // A ring whose section is a regular octagon, of 200 sectors: at a hundredth of its radius.
  std::vector<Eigen::Vector2d> section;
  for (int k = 0; k < 8; ++k)
    section.emplace_back(1 + 0.3 * std::cos(k * kPi / 4), 0.3 * std::sin(k * kPi / 4));
  Shape ring = shape_of(closed_meshes::ring(200, section));
  ring.concavity = 0.01;
  const std::vector<Shape> parts = tc::convex_parts(ring);
  const double exact = 200 * std::sin(kPi / 100) * 4 * std::sin(kPi / 4) * 0.09;
  CHECK(parts.size() <= 64);
  CHECK(volume(parts) > exact);
  CHECK(volume(parts) < exact * (1 + 0.01 / 0.3));
  // No point of the surface is deeper in its part than that.
  for (const Shape& part : parts) {
    const auto faces = tether::linalg::hull_faces(part.points);
    double deepest = 0;
    for (const Vector3d& p : ring.points) {
      double depth = 1e300;
      for (const auto& face : faces) {
        const Vector3d a = part.points[face[0]];
        const Vector3d n = (part.points[face[1]] - a).cross(part.points[face[2]] - a).normalized();
        depth = std::min(depth, n.dot(part.position + a - p));
      }
      deepest = std::max(deepest, depth);
    }
    CHECK(deepest < 0.01);
  }
}

TEST_CASE("parts: a convex mesh is one shape with its points", "[stepping]") {
  Surface s = cube();
  const std::vector<Vector3d> points = s.points;
  s.points.emplace_back(7, 8, 9);  // of no triangle
  Shape mesh = shape_of(s);
  mesh.position = {1, 2, 3};
  const std::vector<Shape> parts = tc::convex_parts(mesh);
  REQUIRE(parts.size() == 1);
  CHECK(parts[0].kind == tc::ShapeKind::convex);
  CHECK(parts[0].points == points);
  CHECK(parts[0].position == mesh.position);
}

TEST_CASE("parts: what bounds no solid is refused with its triangle or edge", "[stepping]") {
  const Surface good = cube();
  Surface s = good;
  s.triangles.pop_back();
  check_error(shape_of(s), "belongs to no other triangle");
  s = good;
  std::swap(s.triangles[3][0], s.triangles[3][1]);
  check_error(shape_of(s), "in the same direction: turn one of them");
  s = good;
  for (std::array<int, 3>& t : s.triangles) std::swap(t[0], t[1]);
  check_error(shape_of(s), "must be > 0 m^3: they run counterclockwise");
  s = good;
  s.points.push_back((s.points[0] + s.points[1]) / 2);
  s.triangles.push_back({0, 1, static_cast<int>(s.points.size()) - 1});
  check_error(shape_of(s), "triangle 12, [0, 1, 8], has no area");
  // Two cubes that pass through each other, one within the other, and with an edge in common.
  for (const auto& [move, scale, text] :
       {std::tuple{Vector3d(0.4, 0.3, 0.2), 1.0, "pass through each other"},
        std::tuple{Vector3d(0.1, 0.3, 0.3), 0.3, "must be 1: no closed piece of it"},
        std::tuple{Vector3d(0.8, 1, 0), 1.0, "pass the edge"}}) {
    s = good;
    const int n = static_cast<int>(good.points.size());
    for (const Vector3d& p : good.points) s.points.push_back(scale * p + move);
    for (const std::array<int, 3>& t : good.triangles)
      s.triangles.push_back({t[0] + n, t[1] + n, t[2] + n});
    check_error(shape_of(s), text);
  }
  // A cube within a cube that is turned the other way is a cavity.
  s = good;
  for (const Vector3d& p : good.points) s.points.push_back(0.3 * p + Vector3d(0.1, 0.3, 0.3));
  for (const std::array<int, 3>& t : good.triangles)
    s.triangles.push_back({t[1] + 8, t[0] + 8, t[2] + 8});
  CHECK(volume(tc::convex_parts(shape_of(s))) == Approx(0.8 * (1 - 0.027)).epsilon(1e-13));
  Shape mesh = shape_of(good);
  mesh.concavity = -1;
  check_error(mesh, "concavity = -1");
  mesh.concavity = std::nan("");
  check_error(mesh, "concavity");
  check_error(Shape::box({1, 1, 1}), "only a mesh");
  mesh = shape_of(good);
  mesh.triangles[0][0] = 8;
  check_error(mesh, "names point 8 of 8");
  // Hollow everywhere: a bumpy ball whose parts would be thousands.
  s = closed_meshes::ring(80, [] {
    std::vector<Eigen::Vector2d> section;
    for (int k = 0; k < 60; ++k)
      section.emplace_back(1 + 0.3 * std::cos(k * kPi / 30), 0.3 * std::sin(k * kPi / 30));
    return section;
  }());
  for (std::size_t k = 0; k < s.points.size(); ++k)
    s.points[k] *= 1 + 0.02 * std::sin(37.0 * static_cast<double>(k));
  check_error(shape_of(s), "give concavity");
}

namespace {

std::vector<Shape> bodies() {
  std::vector<Vector3d> corners;
  for (int k = 0; k < 6; ++k)
    for (const double z : {-0.2, 0.15})
      corners.emplace_back((0.3 - z / 2) * std::cos(k * kPi / 3), 0.25 * std::sin(k * kPi / 3), z);
  std::vector<Vector3d> feet;
  for (const double x : {-0.2, 0.2})
    for (const double y : {-0.15, 0.15}) feet.emplace_back(x, y, -0.15);
  return {
      Shape::sphere(0.2),          Shape::capsule(0.1, 0.5),           Shape::box({0.5, 0.4, 0.3}),
      Shape::convex(corners),      Shape::ellipsoid({0.3, 0.2, 0.15}), Shape::cylinder(0.25, 0.3),
      Shape::touching_points(feet)};
}
double half_height(const Shape& s) {
  if (s.kind == tc::ShapeKind::convex) return 0.2;
  if (s.kind == tc::ShapeKind::points || s.kind == tc::ShapeKind::ellipsoid) return 0.15;
  if (s.kind == tc::ShapeKind::capsule) return 0.35;
  return s.radius > 0 && s.length == 0 ? s.radius : 0.5 * (s.size.z() + s.length);
}

}  // namespace

TEST_CASE("parts: on the flat side of many bodies move as on one", "[stepping]") {
  const std::vector<Shape> shapes = bodies();
  // A slab of cells, each a part, and one that is whole.
  std::vector<Shape> cells;
  for (int i = 0; i < 12; ++i)
    for (int k = 0; k < 6; ++k) {
      Shape cell = Shape::convex({});
      for (int c = 0; c < 8; ++c)
        cell.points.emplace_back((c & 1) * 0.37, (c & 2) / 2 * 0.4, (c & 4) / 4 - 1);
      cell.position = {-2 + 0.37 * i, -1.2 + 0.4 * k, 0};
      cells.push_back(cell);
    }
  Shape whole = Shape::box({12 * 0.37, 6 * 0.4, 1});
  whole.position = {-2 + 6 * 0.37, 0, -0.5};
  const Quaterniond turn(AngleAxisd(0.35, Vector3d(0.3, 1, 0.2).normalized()));
  for (std::size_t k = 0; k < shapes.size(); ++k)
    for (const bool turned : {false, true})
      for (const bool rests : {false, true}) {
        INFO("shape " << k << (turned ? ", turned" : "") << (rests ? ", slides" : ", falls"));
        // Points of a tilted cylinder that are ahead of the touching one are found over one part.
        if (shapes[k].kind == tc::ShapeKind::cylinder && !rests) continue;
        const Quaterniond frame = turned ? turn : Quaterniond::Identity();
        std::vector<tc::Stepper> both;
        for (const bool one : {true, false}) {
          Scene scene(2e-3);
          scene.friction(rests ? 0.3 : 0.4, rests ? 0 : 0.3);
          scene.options.tolerance = 1e-13;  // a new part is a new start of the solver
          scene.options.gravity = frame * Vector3d(0, 0, -kGravity);
          const Quaterniond q =
              rests ? frame
                    : Quaterniond(frame * AngleAxisd(0.7, Vector3d(1, 2, 0.5).normalized()));
          const int i = scene.bodies.add(
              1, Vector3d(0.02, 0.025, 0.03).asDiagonal(),
              frame * Vector3d(-1.6, 0.2, rests ? half_height(shapes[k]) : 0.6), q,
              frame * Vector3d(1.5, -0.4, 0), rests ? Vector3d(0, 0, 0) : Vector3d(1, 2, 0.5));
          scene.surfaces.push_back({i, shapes[k], 0});
          const int ground = scene.bodies.add_fixed(Vector3d::Zero(), frame);
          if (one)
            scene.surfaces.push_back({ground, whole, 1});
          else
            for (const Shape& cell : cells) scene.surfaces.push_back({ground, cell, 1});
          both.push_back(scene.stepper());
          run(both.back(), 0.8);
        }
        // The solver starts anew where a body comes to another part: that is seen where it bounces.
        const double same = rests ? 1e-6 : 1e-4;
        CHECK((position(both[0], 0) - position(both[1], 0)).norm() < same);
        CHECK(both[0].bodies().orientation[0].angularDistance(both[1].bodies().orientation[0]) <
              10 * same);
      }
}
