// Touching points against every shape that is not a mesh: where they are nearest, by proof, and
// motion against closed forms. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <random>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using tc::Shape;

const std::vector<Vector3d> kTetrahedron{
    {0.5, 0, -0.3}, {-0.3, 0.4, -0.3}, {-0.3, -0.4, -0.3}, {0, 0.1, 0.5}};

// max n.x over the shape, in its axes.
double support(const Shape& s, const Vector3d& n) {
  switch (s.kind) {
    case tc::ShapeKind::sphere:
      return s.radius;
    case tc::ShapeKind::capsule:
      return s.radius + 0.5 * s.length * std::abs(n.z());
    case tc::ShapeKind::box:
      return 0.5 * s.size.dot(n.cwiseAbs());
    case tc::ShapeKind::ellipsoid:
      return s.size.cwiseProduct(n).norm();
    case tc::ShapeKind::cylinder:
      return s.radius * std::hypot(n.x(), n.y()) + 0.5 * s.length * std::abs(n.z());
    default: {
      double most = -1e300;
      for (const Vector3d& p : s.points) most = std::max(most, n.dot(p));
      return most;
    }
  }
}

struct Found {
  tc::StepContacts contacts;
  Vector3d at;  // of the point, where the step began
};

// The contact of one point, at `p` in the axes of a shape that stands somewhere.
Found touch(const Shape& shape, const Vector3d& p, const Vector3d& where, const Quaterniond& turned,
            bool shape_first) {
  Scene scene(1e-9);
  scene.friction(0.3);
  scene.options.gravity.reset();
  scene.options.near_part = 20;
  scene.options.error_reduction = 0;
  const auto add_shape = [&] {
    scene.surfaces.push_back({scene.bodies.add_fixed(where, turned), shape, 0});
  };
  const Vector3d arm(0.4, 0.1, -0.2), at = where + turned * p;
  if (shape_first) add_shape();
  const Quaterniond own(AngleAxisd(1, Vector3d(1, 2, 3).normalized()));
  const int i = scene.bodies.add(1, Matrix3d::Identity(), at - own * arm, own);
  scene.surfaces.push_back({i, Shape::touching_points({arm}), 0});
  if (!shape_first) add_shape();
  tc::Stepper s = scene.stepper();
  s.step();
  return {s.contacts(), at};
}

}  // namespace

TEST_CASE("points: gap and normal are those of the nearest point of each shape") {
  const std::vector<Shape> shapes{Shape::sphere(0.4),
                                  Shape::capsule(0.2, 0.7),
                                  Shape::box({0.5, 0.7, 0.4}),
                                  Shape::ellipsoid({0.5, 0.3, 0.2}),
                                  Shape::ellipsoid({0.9, 0.9, 1e-3}),
                                  Shape::ellipsoid({0.3, 0.3, 0.3}),
                                  Shape::cylinder(0.3, 0.7),
                                  Shape::convex(kTetrahedron)};
  std::mt19937 g(11);
  std::normal_distribution<double> d;
  for (const Shape& shape : shapes)
    for (int k = 0; k < 60; ++k) {
      // Outside, inside, on an axis, on a plane of symmetry, in the middle.
      Vector3d p(0.4 * d(g), 0.4 * d(g), 0.4 * d(g));
      if (k % 3 == 1) p *= 0.1;
      if (k % 10 == 7) p.x() = p.y() = 0;
      if (k % 10 == 8) p.z() = 0;
      if (k == 59) p.setZero();
      const Quaterniond turned = Quaterniond(d(g), d(g), d(g), d(g)).normalized();
      const Vector3d where(3, -2, 1);
      const Found f = touch(shape, p, where, turned, k % 2 == 0);
      CAPTURE(name(shape.kind), k, p.transpose());
      REQUIRE(f.contacts.gaps.size() == 1);
      const double gap = f.contacts.gaps[0];
      const double side = k % 2 == 0 ? -1 : 1;  // the normal goes to the first body
      const Vector3d n = turned.conjugate() * (side * f.contacts.points[0].normal);
      const Vector3d x = p - gap * n;
      // All of the shape is behind the plane across n through x, and x is on it: no other point is
      // nearer, and inside no other way out is shorter in the directions tried.
      CHECK(std::abs(n.norm() - 1) < 1e-14);
      CHECK(std::abs(support(shape, n) - n.dot(x)) < 1e-14);
      for (int j = 0; j < 200; ++j) {
        const Vector3d m = Vector3d(d(g), d(g), d(g)).normalized();
        REQUIRE(m.dot(x) < support(shape, m) + 1e-13);  // x belongs to the shape
        REQUIRE(m.dot(p) - support(shape, m) < gap + 1e-13);
      }
    }
}

TEST_CASE("points: a particle leaves a smooth sphere at the height of the closed form") {
  // R = 1, v0 = 0.5 at the top: it leaves at cos = 2/3 + v0^2 / (3 g R) and falls to z = -1.
  std::vector<double> error;
  for (const double dt : {2e-3, 1e-3, 5e-4}) {
    Scene scene(dt);
    scene.friction(0);
    const int ball = scene.bodies.add_fixed(Vector3d::Zero());
    scene.surfaces.push_back({ball, Shape::sphere(1), 0});
    const int grain = scene.bodies.add(1, Matrix3d::Identity(), {0, 0, 1}, Quaterniond::Identity(),
                                       {0.3, 0.4, 0});
    scene.surfaces.push_back({grain, Shape::touching_points({{0, 0, -1e-7}}), 0});
    tc::Stepper s = scene.stepper();
    while (position(s, grain).z() > -1) s.step();
    const Vector3d x = position(s, grain), v = velocity(s, grain);
    const double late = (-1 - x.z()) / -v.z();
    const Vector3d there = x - late * v;
    CHECK(std::abs(there.y() / there.x() - 4.0 / 3) < 1e-9);
    error.push_back(std::abs(std::hypot(there.x(), there.y()) - 1.47107772505707675));
  }
  INFO("errors " << error[0] << " " << error[1] << " " << error[2]);
  CHECK(error[2] < 1e-3);
  CHECK(error[0] / error[2] > 2.5);
}

TEST_CASE("points: feet slide on a box, on a hull and on a plane as far, and stop") {
  // Down a slope of 20 degrees with mu = 0.5 from 1 m/s: v^2 / (2 g (mu cos - sin)).
  const double slope = radians(20), mu = 0.5,
               way = 0.5 / (kGravity * (mu * std::cos(slope) - std::sin(slope)));
  const Quaterniond turned(AngleAxisd(slope, Vector3d::UnitY()));
  const Vector3d size(4, 2, 0.5);
  std::vector<Vector3d> corners;
  for (int k = 0; k < 8; ++k)
    corners.emplace_back((k & 1) != 0 ? 2 : -2, (k & 2) != 0 ? 1 : -1, (k & 4) != 0 ? 0.25 : -0.25);
  std::vector<double> ways;
  for (const Shape& shape :
       {Shape::plane(Vector3d::UnitZ()), Shape::box(size), Shape::convex(corners)}) {
    Scene scene(1e-3);
    scene.friction(mu);
    const double top = shape.kind == tc::ShapeKind::plane ? 0 : 0.25;
    scene.surfaces.push_back({scene.bodies.add_fixed(Vector3d::Zero(), turned), shape, 0});
    const int table =
        scene.bodies.add(2, box_inertia(2, {0.4, 0.2, 0.1}), turned * Vector3d(-1, 0, top + 0.1),
                         turned, turned * Vector3d(1, 0, 0));
    scene.surfaces.push_back(
        {table,
         Shape::touching_points(
             {{0.2, 0.1, -0.1}, {-0.2, 0.1, -0.1}, {0.2, -0.1, -0.1}, {-0.2, -0.1, -0.1}}),
         0});
    tc::Stepper s = scene.stepper();
    run(s, 1);
    CHECK(velocity(s, table).norm() < 1e-12);
    ways.push_back((turned.conjugate() * position(s, table)).x() + 1);
    CHECK(std::abs(ways.back() - way) < 1e-3);
    CHECK(std::abs((turned.conjugate() * position(s, table)).z() - top - 0.1) < 1e-9);
  }
  CHECK(std::abs(ways[1] - ways[0]) < 1e-9);
  CHECK(std::abs(ways[2] - ways[0]) < 1e-9);
}

TEST_CASE("points: those of two bodies pass through each other") {
  Scene scene(1e-2);
  scene.friction(0.3, 0.5);
  scene.options.gravity.reset();
  for (const double v : {1.0, -1.0}) {
    const int i = scene.bodies.add(1, Matrix3d::Identity(), {-0.1 * v, 0, 0},
                                   Quaterniond::Identity(), {v, 0, 0});
    scene.surfaces.push_back({i, Shape::touching_points({{0, 0, -0.1}, {0, 0, 0.1}}), 0});
  }
  tc::Stepper s = scene.stepper();
  run(s, 1);
  CHECK(velocity(s, 0).x() == 1);
  CHECK(velocity(s, 1).x() == -1);
  CHECK(s.counts().contact_problems == 0);
}
