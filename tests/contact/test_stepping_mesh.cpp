// Meshes of triangles: a flat one is a plane, and others against closed forms and searches.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <limits>
#include <random>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using tc::Shape;
using Triangles = std::vector<std::array<int, 3>>;

struct Surface {
  std::vector<Vector3d> points;
  Triangles triangles;
  Shape shape() const { return Shape::mesh(points, triangles); }
};

// n x n squares of about 0.2 m about the origin, whose corners lie anywhere and have heights.
template <class Height>
Surface patches(int n, const Height& height) {
  std::mt19937 g(7);
  std::uniform_real_distribution<double> off(-0.06, 0.06);
  Surface s;
  for (int k = 0; k <= n; ++k)
    for (int i = 0; i <= n; ++i) {
      const double x = 0.2 * (i - 0.5 * n) + off(g), y = 0.2 * (k - 0.5 * n) + off(g);
      s.points.emplace_back(x, y, height(x, y));
    }
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < n; ++i) {
      const int p = k * (n + 1) + i;
      if ((i + k) % 2 == 0) {
        s.triangles.push_back({p, p + 1, p + n + 2});
        s.triangles.push_back({p, p + n + 2, p + n + 1});
      } else {
        s.triangles.push_back({p + 1, p + n + 2, p + n + 1});
        s.triangles.push_back({p + 1, p + n + 1, p});
      }
    }
  return s;
}
double flat(double, double) { return 0; }

std::vector<Shape> solids() {
  std::vector<Vector3d> corners;
  for (int k = 0; k < 6; ++k)
    for (const double z : {-0.2, 0.15})
      corners.emplace_back((0.3 - z / 2) * std::cos(k * kPi / 3), 0.25 * std::sin(k * kPi / 3), z);
  return {Shape::sphere(0.2),     Shape::capsule(0.1, 0.5),           Shape::box({0.5, 0.4, 0.3}),
          Shape::convex(corners), Shape::ellipsoid({0.3, 0.2, 0.15}), Shape::cylinder(0.25, 0.3)};
}

int add_body(Scene& scene, const Shape& shape, const Vector3d& at, const Quaterniond& turned,
             const Vector3d& v = Vector3d::Zero(), const Vector3d& w = Vector3d::Zero()) {
  const int i = scene.bodies.add(1, Vector3d(0.02, 0.025, 0.03).asDiagonal(), at, turned, v, w);
  scene.surfaces.push_back({i, shape, 0});
  return i;
}
int add_mesh(Scene& scene, const Shape& mesh, const Vector3d& at = Vector3d::Zero(),
             const Quaterniond& turned = Quaterniond::Identity()) {
  const int i = scene.bodies.add_fixed(at, turned);
  scene.surfaces.push_back({i, mesh, 1});
  return i;
}

// Gaps of one shape at rest and a mesh, up to any size.
tc::StepContacts contacts_of(const Shape& shape, const Vector3d& at, const Quaterniond& turned,
                             const Shape& mesh) {
  Scene scene(1e-6);
  scene.friction(0.5);
  scene.options.gravity.reset();
  scene.options.near_part = 2;
  scene.options.error_reduction = 0;
  add_body(scene, shape, at, turned);
  add_mesh(scene, mesh);
  tc::Stepper s = scene.stepper();
  s.step();
  return s.contacts();
}

Vector3d nearest_on_triangle(const Vector3d& x, const std::array<Vector3d, 3>& p) {
  const Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  bool inside = true;
  Vector3d best = p[0];
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d a = p[k], d = p[(k + 1) % 3] - a;
    inside = inside && n.cross(d).dot(x - a) >= 0;
    const Vector3d q = a + std::clamp((x - a).dot(d) / d.squaredNorm(), 0.0, 1.0) * d;
    if ((x - q).norm() < least) least = (x - q).norm(), best = q;
  }
  return inside ? Vector3d(x - n.dot(x - p[0]) * n) : best;
}
// Distance of a box or a sphere from a mesh; alternating projections onto two convex sets end at
// it.
double distance(const Shape& shape, const Vector3d& at, const Quaterniond& turned,
                const Surface& mesh) {
  const Vector3d half = 0.5 * shape.size;
  double least = std::numeric_limits<double>::infinity();
  for (const std::array<int, 3>& t : mesh.triangles) {
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[static_cast<std::size_t>(t[k])];
    Vector3d x = at, y;
    double before = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 20000; ++k) {
      y = nearest_on_triangle(x, p);
      const double now = (x - y).norm() - shape.radius;
      if (before - now < 1e-14 || now - 0.5 > least) break;
      before = now;
      x = at + turned * (turned.conjugate() * (y - at)).cwiseMax(-half).cwiseMin(half).eval();
    }
    least = std::min(least, (x - y).norm() - shape.radius);
  }
  return least;
}

double hills(double x, double y) { return 0.15 * std::sin(5 * x) * std::cos(4 * y); }

}  // namespace

TEST_CASE("mesh: on a flat one of many triangles bodies move as on the plane", "[stepping]") {
  const Surface ground = patches(40, flat);
  const Quaterniond turn(AngleAxisd(0.35, Vector3d(0.3, 1, 0.2).normalized()));
  Surface turned = ground;
  for (Vector3d& p : turned.points) p = turn * p;
  const auto shapes = solids();
  for (std::size_t k = 0; k < shapes.size(); ++k)
    for (const bool by_points : {false, true})
      for (const bool rests : {false, true}) {
        INFO("shape " << k << (by_points ? ", points turned" : ", body turned")
                      << (rests ? ", slides" : ", falls"));
        std::vector<tc::Stepper> both;
        for (const bool plane : {true, false}) {
          Scene scene(2e-3);
          scene.friction(rests ? 0.3 : 0.4, rests ? 0 : 0.3);
          const Quaterniond q =
              rests ? turn : Quaterniond(turn * AngleAxisd(0.7, Vector3d(1, 2, 0.5).normalized()));
          const double height = rests ? 0.5 * (shapes[k].size[2] + shapes[k].length) : 0.6;
          add_body(scene, shapes[k], turn * Vector3d(-1.6, 0.2, height + (rests ? 0.001 : 0)), q,
                   turn * Vector3d(1.5, -0.4, 0), rests ? Vector3d(0, 0, 0) : Vector3d(1, 2, 0.5));
          if (plane) {
            scene.ground(turn * Vector3d::UnitZ());
          } else if (by_points) {
            add_mesh(scene, turned.shape());
          } else {
            add_mesh(scene, ground.shape(), Vector3d::Zero(), turn);
          }
          both.push_back(scene.stepper());
          run(both.back(), 0.8);
        }
        CHECK((position(both[0], 0) - position(both[1], 0)).norm() < 1e-9);
        CHECK(both[0].bodies().orientation[0].angularDistance(both[1].bodies().orientation[0]) <
              1e-9);
        CHECK(both[0].contacts().gaps.size() == both[1].contacts().gaps.size());
        CHECK(velocity(both[1], 0).norm() > 0.1);
      }
}

TEST_CASE("mesh: the least gap is the distance, with points on both", "[stepping]") {
  const Surface ground = patches(12, hills);
  std::mt19937 g(11);
  std::uniform_real_distribution<double> u(-0.9, 0.9);
  std::normal_distribution<double> d;
  int apart = 0;
  for (int k = 0; k < 120; ++k) {
    const Shape shape = k % 2 == 0 ? Shape::box({0.4, 0.3, 0.2}) : Shape::sphere(0.15);
    const Vector3d at(u(g), u(g), 0.25 + 0.1 * u(g));
    const Quaterniond q = Quaterniond(d(g), d(g), d(g), d(g)).normalized();
    const double truth = distance(shape, at, q, ground);
    if (!(truth > 1e-3)) continue;
    ++apart;
    INFO("pose " << k);
    const tc::StepContacts c = contacts_of(shape, at, q, ground.shape());
    REQUIRE(!c.gaps.empty());
    const auto least = std::min_element(c.gaps.begin(), c.gaps.end());
    CHECK(std::abs(*least - truth) < 1e-7);
    // Every gap is one: its point of the body is on or above that of the surface.
    const auto& p = c.points[static_cast<std::size_t>(least - c.gaps.begin())];
    const Vector3d foot = at + p.r1 - *least * p.normal;
    CHECK(distance(Shape::sphere(1e-300), foot, q, ground) < 1e-9);
  }
  CHECK(apart > 60);
}

TEST_CASE("mesh: bodies behind it pass, bodies before it do not", "[stepping]") {
  for (const auto& shape : solids())
    for (const double side : {1.0, -1.0}) {
      Scene scene(1e-3);
      scene.friction(0.3);
      scene.options.gravity.reset();
      add_body(scene, shape, Vector3d(0.03, 0.02, 0.6 * side), Quaterniond::Identity(),
               Vector3d(0, 0, -3 * side));
      add_mesh(scene, patches(6, flat).shape());
      tc::Stepper s = scene.stepper();
      run(s, 0.5);
      if (side > 0)
        CHECK(std::abs(velocity(s, 0).z()) < 1e-6);
      else
        CHECK(velocity(s, 0).z() == 3);
    }
}

TEST_CASE("mesh: a ball rests in a valley and in a pit, radius over cosine high", "[stepping]") {
  std::vector<double> heights;
  for (int k = 0; k < 5; ++k)
    for (int i = 0; i < 5; ++i) heights.push_back(0.75 * 0.3 * std::abs(i - 2));
  const Shape valley = Shape::height_field(heights, 5, 0.3, 0.3);
  const Shape pit =
      Shape::mesh({{0, 0, 0.45}, {1.2, 0, 0.45}, {1.2, 1.2, 0.45}, {0, 1.2, 0.45}, {0.6, 0.6, 0}},
                  {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}});
  for (const Shape& shape : {valley, pit}) {
    Scene scene(2e-3);
    scene.friction(0.2);
    const int ball = scene.sphere(0.1, 1, Vector3d(0.7, 0.65, 0.6));
    add_mesh(scene, shape);
    tc::Stepper s = scene.stepper();
    run(s, 4);
    INFO(shape.points.size());
    CHECK(std::abs(position(s, ball).x() - 0.6) < 1e-6);
    CHECK(std::abs(position(s, ball).z() - 0.1 / 0.8) < 1e-6);
    if (shape.points.size() == 5) CHECK(std::abs(position(s, ball).y() - 0.6) < 1e-6);
    CHECK(velocity(s, ball).norm() < 1e-6);
  }
}

TEST_CASE("mesh: a box on its edge stands while its middle is over it", "[stepping]") {
  for (const double beyond : {-2e-3, 2e-3}) {
    Scene scene(2e-3);
    scene.friction(0.6);
    // Two triangles: x from -2 to 0.
    add_mesh(scene,
             Shape::mesh({{-2, -1, 0}, {0, -1, 0}, {0, 1, 0}, {-2, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}));
    const int box = scene.box({0.4, 0.3, 0.2}, 2, Vector3d(beyond, 0.05, 0.1),
                              Quaterniond(AngleAxisd(0.3, Vector3d::UnitZ())));
    tc::Stepper s = scene.stepper();
    run(s, 3);
    INFO(beyond);
    if (beyond < 0)
      CHECK((position(s, box) - Vector3d(beyond, 0.05, 0.1)).norm() < 1e-5);
    else
      CHECK(position(s, box).z() < -1);
  }
}

TEST_CASE("mesh: peaks and ridges carry a box, turned or not", "[stepping]") {
  for (const bool ridges : {false, true})
    for (const double angle : {0.0, 0.4}) {
      std::vector<double> heights;
      for (int k = 0; k < 9; ++k)
        for (int i = 0; i < 9; ++i)
          heights.push_back(i % 4 == 2 && (ridges || k % 4 == 2) ? 0.2 : 0.0);
      Scene scene(2e-3);
      scene.friction(0.5);
      add_mesh(scene, Shape::height_field(heights, 9, 0.1, 0.1));
      const Vector3d at(0.41, 0.39, 0.35);
      const int box = scene.box({0.7, 0.65, 0.3}, 2, at + Vector3d(0, 0, 0.002),
                                Quaterniond(AngleAxisd(angle, Vector3d::UnitZ())));
      tc::Stepper s = scene.stepper();
      run(s, 1);
      INFO(ridges << ", " << angle);
      CHECK((position(s, box) - at).norm() < 1e-6);
      CHECK(angular_velocity(s, box).norm() < 1e-6);
      CHECK(s.contacts().gaps.size() >= 4);
    }
}

TEST_CASE("mesh: what is no mesh is refused by name", "[stepping]") {
  using Catch::Matchers::Contains;
  const std::vector<Vector3d> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const auto make = [](const Shape& shape) {
    Scene scene;
    scene.friction(0);
    scene.sphere(0.1, 1, {0, 0, 1});
    add_mesh(scene, shape);
    return scene.stepper();
  };
  CHECK_NOTHROW(make(Shape::mesh(points, {{0, 1, 2}})));
  CHECK_THROWS_WITH(make(Shape::mesh(points, {})), Contains("triangles"));
  CHECK_THROWS_WITH(make(Shape::mesh(points, {{0, 1, 3}})), Contains("point 3 of 3"));
  CHECK_THROWS_WITH(make(Shape::mesh(points, {{0, -1, 2}})), Contains("point -1"));
  CHECK_THROWS_WITH(make(Shape::mesh(points, {{0, 1, 1}, {2, 2, 0}})), Contains("has an area"));
  CHECK_THROWS_WITH(make(Shape::mesh({{0, 0, 0}, {1, 0, 0}, {0, std::nan(""), 0}}, {{0, 1, 2}})),
                    Contains("finite"));
  CHECK_THROWS_WITH(Shape::height_field({0, 0, 0}, 2, 1, 1), Contains("2 x 2"));
  Scene moving;
  moving.friction(0);
  add_body(moving, Shape::mesh(points, {{0, 1, 2}}), Vector3d::Zero(), Quaterniond::Identity());
  CHECK_THROWS_WITH(moving.stepper(), Contains("fixed body"));
  Scene pins;
  pins.friction(0);
  add_body(pins, Shape::touching_points(points), Vector3d::Zero(), Quaterniond::Identity());
  add_mesh(pins, Shape::mesh(points, {{0, 1, 2}}));
  CHECK_THROWS_WITH(pins.stepper(), Contains("contact of points and mesh"));
}

TEST_CASE("mesh: triangles without an area and loose ones do no harm", "[stepping]") {
  Scene scene(2e-3);
  scene.friction(0.3);
  const int ball = scene.sphere(0.2, 1, {0.1, 0.1, 0.4});
  add_mesh(scene,
           Shape::mesh({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1, 0}, {1, 1, 0}},
                       {{0, 1, 2}, {4, 5, 3}, {0, 0, 1}, {0, 1, 1}, {0, 2, 5}}));
  tc::Stepper s = scene.stepper();
  run(s, 1);
  CHECK(std::abs(position(s, ball).z() - 0.2) < 1e-6);
}
