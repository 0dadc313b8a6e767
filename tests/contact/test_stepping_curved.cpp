// Ellipsoids and cylinders: where they touch, against closed forms and searches, and how they rest
// and roll. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <random>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using tc::Shape;

struct Placed {
  Shape shape;
  Vector3d at;
  Quaterniond turned;
};

Matrix3d some_inertia() { return Vector3d(1, 1.2, 1.5).asDiagonal(); }

// Contacts of two shapes, or of one and the plane z = 0, with gaps of any size.
tc::StepContacts contacts_of(const std::vector<Placed>& shapes, bool second_fixed = false) {
  Scene scene(1e-6);
  scene.friction(0.5);
  scene.options.gravity.reset();
  scene.options.near_part = 5;
  scene.options.error_reduction = 0;
  if (shapes.size() == 1) scene.ground();
  for (const Placed& p : shapes) {
    const int i = second_fixed && &p != &shapes[0]
                      ? scene.bodies.add_fixed(p.at, p.turned)
                      : scene.bodies.add(1, some_inertia(), p.at, p.turned);
    scene.surfaces.push_back({i, p.shape, 0});
  }
  tc::Stepper s = scene.stepper();
  s.step();
  return s.contacts();
}

double least_gap(const tc::StepContacts& c) {
  REQUIRE(!c.gaps.empty());
  return *std::min_element(c.gaps.begin(), c.gaps.end());
}

Quaterniond any_turn(std::mt19937& g) {
  std::normal_distribution<double> d;
  return Quaterniond(d(g), d(g), d(g), d(g)).normalized();
}
Vector3d any_direction(std::mt19937& g) {
  std::normal_distribution<double> d;
  return Vector3d(d(g), d(g), d(g)).normalized();
}

// max m.x over the shape: an implementation of its own.
double support(const Placed& p, const Vector3d& m) {
  const Vector3d u = p.turned.conjugate() * m;
  const Shape& s = p.shape;
  double h = 0;
  switch (s.kind) {
    case tc::ShapeKind::ellipsoid:
      h = s.size.cwiseProduct(u).norm();
      break;
    case tc::ShapeKind::cylinder:
      h = s.radius * std::hypot(u[0], u[1]) + 0.5 * s.length * std::abs(u[2]);
      break;
    case tc::ShapeKind::sphere:
      h = s.radius;
      break;
    case tc::ShapeKind::capsule:
      h = s.radius + 0.5 * s.length * std::abs(u[2]);
      break;
    case tc::ShapeKind::box:
      h = 0.5 * s.size.dot(u.cwiseAbs());
      break;
    default:
      for (std::size_t k = 0; k < s.points.size(); ++k)
        h = k == 0 ? u.dot(s.points[k]) : std::max(h, u.dot(s.points[k]));
  }
  return m.dot(p.at) + h;
}

// Larger gap along some direction.
double some_gap(const Placed& a, const Placed& b) {
  std::mt19937 g(5);
  double most = -1e9;
  for (int k = 0; k < 1000; ++k) {
    const Vector3d n = k == 0 ? Vector3d((a.at - b.at).normalized()) : any_direction(g);
    most = std::max(most, -support(a, -n) - support(b, n));
  }
  return most;
}

// How far x is outside of the shape, along some direction.
double outside(const Placed& p, const Vector3d& x) {
  const Vector3d u = p.turned.conjugate() * (x - p.at);
  const Shape& s = p.shape;
  switch (s.kind) {
    case tc::ShapeKind::ellipsoid:
      return (u.cwiseQuotient(s.size).norm() - 1) * s.size.minCoeff();
    case tc::ShapeKind::cylinder:
      return std::max(std::hypot(u[0], u[1]) - s.radius, std::abs(u[2]) - 0.5 * s.length);
    case tc::ShapeKind::sphere:
      return u.norm() - s.radius;
    case tc::ShapeKind::capsule:
      return std::hypot(std::hypot(u[0], u[1]), std::max(0.0, std::abs(u[2]) - 0.5 * s.length)) -
             s.radius;
    case tc::ShapeKind::box:
      return (u.cwiseAbs() - 0.5 * s.size).maxCoeff();
    default: {
      double most = -1e9;  // of all planes through three points that have the others behind them
      for (std::size_t i = 0; i < 4; ++i) {
        const Vector3d &a = s.points[i], &b = s.points[(i + 1) % 4], &c = s.points[(i + 2) % 4];
        Vector3d n = (b - a).cross(c - a).normalized();
        if (n.dot(s.points[(i + 3) % 4] - a) > 0) n = -n;
        most = std::max(most, n.dot(u - a));
      }
      return most;
    }
  }
}

Shape tetrahedron() {
  return Shape::convex({{0.5, 0, -0.3}, {-0.3, 0.4, -0.3}, {-0.3, -0.4, -0.3}, {0, 0.1, 0.5}});
}

std::vector<Shape> others() {
  return {Shape::ellipsoid({0.5, 0.3, 0.2}), Shape::cylinder(0.3, 0.7),   Shape::sphere(0.3),
          Shape::capsule(0.2, 0.6),          Shape::box({0.5, 0.7, 0.4}), tetrahedron()};
}

}  // namespace

TEST_CASE("shapes: an ellipsoid over a plane has the gap of its support function") {
  std::mt19937 g(1);
  for (int k = 0; k < 50; ++k) {
    const Placed p{Shape::ellipsoid({0.9, 0.4, 0.1}), Vector3d(0.3, -2, 0.5), any_turn(g)};
    const tc::StepContacts c = contacts_of({p});
    REQUIRE(c.gaps.size() == 1);
    CHECK(c.gaps[0] == Approx(0.5 - (support(p, Vector3d::UnitZ()) - 0.5)).margin(1e-15));
    // The point is on the ellipsoid, and its normal there is the plane's.
    const Vector3d x = p.turned.conjugate() * c.points[0].r1;
    const Vector3d square = p.shape.size.cwiseProduct(p.shape.size);
    CHECK(x.dot(x.cwiseQuotient(square)) == Approx(1).epsilon(1e-13));
    CHECK((p.turned * x.cwiseQuotient(square).normalized() + Vector3d::UnitZ()).norm() < 1e-12);
  }
}

// For shapes that are apart the gap along a normal is at most their distance, and the distance of
// any two of their points at least: where both are equal, normal and points are exact.
TEST_CASE("shapes: points of ellipsoids and cylinders are nearest to each other") {
  std::mt19937 g(2);
  const std::vector<Shape> shapes = others();
  for (std::size_t first = 0; first < 2; ++first)
    for (std::size_t second = 0; second < shapes.size(); ++second)
      for (int k = 0; k < 40; ++k) {
        const Placed a{shapes[first], Vector3d::Zero(), any_turn(g)};
        Placed b{shapes[second], any_direction(g), any_turn(g)};
        const double wanted = k < 20 ? 0.1 : k < 30 ? 1e-3 : 1e-6;
        for (int move = 0; move < 3; ++move) b.at += (wanted - some_gap(a, b)) * b.at.normalized();
        const tc::StepContacts c = contacts_of({a, b}, true);
        INFO(first << " " << second << " " << k);
        REQUIRE(!c.gaps.empty());
        const auto least = static_cast<std::size_t>(std::min_element(c.gaps.begin(), c.gaps.end()) -
                                                    c.gaps.begin());
        const tc::PointContact& p = c.points[least];
        const Vector3d n = p.normal, x = p.r1, y = b.at + p.r2;
        CHECK(-support(a, -n) - support(b, n) == Approx(c.gaps[least]).margin(1e-9));
        CHECK((x - y - c.gaps[least] * n).norm() < 1e-12);
        CHECK(outside(a, x) < 3e-8);
        CHECK(outside(b, y) < 3e-8);
      }
}

TEST_CASE("shapes: ellipsoids and cylinders that overlap have the least depth of all directions") {
  std::mt19937 g(4);
  const std::vector<Shape> shapes = others();
  for (std::size_t first = 0; first < 2; ++first)
    for (std::size_t second = 0; second < shapes.size(); ++second)
      for (int k = 0; k < 10; ++k) {
        const Placed a{shapes[first], Vector3d::Zero(), any_turn(g)};
        Placed b{shapes[second], any_direction(g), any_turn(g)};
        const double wanted = k < 5 ? -1e-3 : -0.02;
        for (int move = 0; move < 3; ++move) b.at += (wanted - some_gap(a, b)) * b.at.normalized();
        const tc::StepContacts c = contacts_of({a, b});
        INFO(first << " " << second << " " << k);
        CHECK(least_gap(c) > some_gap(a, b) - 1e-3);
        const Vector3d n = c.points[0].normal;
        CHECK(least_gap(c) == Approx(-support(a, -n) - support(b, n)).margin(1e-6));
      }
}

TEST_CASE("shapes: ellipsoids turned rigidly touch at the same points") {
  std::mt19937 g(3);
  const std::vector<Shape> shapes = others();
  for (std::size_t first = 0; first < 2; ++first)
    for (std::size_t second = 0; second < shapes.size(); ++second)
      for (int k = 0; k < 8; ++k) {
        const Placed a{shapes[first], Vector3d(0.1, 0.2, 0.3), any_turn(g)};
        const Placed b{shapes[second], a.at + (0.45 + 0.05 * k) * any_direction(g), any_turn(g)};
        const Quaterniond q = any_turn(g);
        const Vector3d t(3, -1, 2);
        const auto moved = [&](const Placed& p) {
          return Placed{p.shape, q * p.at + t, q * p.turned};
        };
        const tc::StepContacts c = contacts_of({a, b}), d = contacts_of({moved(a), moved(b)});
        INFO(first << " " << second << " " << k);
        REQUIRE(c.gaps.size() == d.gaps.size());
        CHECK(std::abs(least_gap(c) - least_gap(d)) < (least_gap(c) > -0.05 ? 1e-9 : 1e-6));
        for (std::size_t i = 0; i < c.gaps.size(); ++i)
          CHECK((q * c.points[i].normal - d.points[i].normal).norm() < 1e-6);
      }
}

TEST_CASE("shapes: a sphere finds the nearest point of a solid cylinder, outside and inside") {
  const Shape cylinder = Shape::cylinder(0.5, 2);
  const auto gap = [&](const Vector3d& c) {
    return least_gap(contacts_of({{cylinder, Vector3d::Zero(), Quaterniond::Identity()},
                                  {Shape::sphere(0.1), c, Quaterniond::Identity()}}));
  };
  CHECK(gap({0, 0.3, 1.4}) == Approx(0.3).epsilon(1e-12));                        // cap
  CHECK(gap({0.6, 0.8, 0.2}) == Approx(0.4).epsilon(1e-12));                      // side
  CHECK(gap({0.9, 0, 1.3}) == Approx(std::hypot(0.4, 0.3) - 0.1).epsilon(1e-9));  // rim
  CHECK(gap({0.42, 0, 0.1}) == Approx(-0.18).epsilon(1e-9));  // inside, by the side
  CHECK(gap({0.1, 0, 0.97}) == Approx(-0.13).epsilon(1e-9));  // by the cap
}

TEST_CASE("shapes: deep inside each other the depth is finite and has a way out") {
  const std::vector<Shape> shapes = others();
  for (const Shape& shape : shapes)
    for (std::size_t first = 0; first < 2; ++first) {
      const tc::StepContacts c = contacts_of(
          {{shapes[first], Vector3d::Zero(), Quaterniond::Identity()},
           {shape, Vector3d(0, 0, 1e-3), Quaterniond(0.9, 0.1, 0.3, 0.2).normalized()}});
      CHECK(least_gap(c) < -0.2);
      CHECK(least_gap(c) > -0.75);
      for (const tc::PointContact& p : c.points) CHECK(p.normal.norm() == Approx(1));
    }
}

TEST_CASE("shapes: a standing cylinder has four points, a lying one two, and gaps follow a tilt") {
  const auto tilted = [](double angle, double height) {
    return contacts_of({{Shape::cylinder(0.1, 0.6), Vector3d(0, 0, height),
                         Quaterniond(AngleAxisd(angle, Vector3d(0.6, 0.8, 0)))}});
  };
  const auto near = [](const tc::StepContacts& c, double gap) {
    return std::count_if(c.gaps.begin(), c.gaps.end(), [&](double g) { return g < gap; });
  };
  CHECK(near(tilted(0, 0.3), 1e-12) == 4);
  CHECK(near(tilted(kPi / 2, 0.1), 1e-12) == 2);
  CHECK(near(tilted(1e-7, 0.3), 1e-6) == 4);
  for (const double angle : {1e-12, 1e-8, 1e-3, 0.5, 1.5, 1.5707, 2.0, 3.1})
    CHECK(least_gap(tilted(angle, 0.4)) ==
          Approx(0.4 - 0.1 * std::sin(angle) - 0.3 * std::abs(std::cos(angle))).epsilon(1e-12));
}

TEST_CASE("shapes: a cylinder rolls down a slope with two thirds of g sin") {
  const double angle = radians(20), r = 0.1, dt = 2e-3, mass = 2;
  Scene scene(dt);
  scene.friction(0.5);
  const Quaterniond slope(AngleAxisd(angle, Vector3d::UnitY()));
  scene.ground(slope * Vector3d::UnitZ());
  const Matrix3d I =
      mass * Vector3d(r * r / 4 + 0.09 / 12, r * r / 4 + 0.09 / 12, r * r / 2).asDiagonal();
  const int body = scene.bodies.add(mass, I, slope * Vector3d(0, 0, r),
                                    slope * Quaterniond(AngleAxisd(kPi / 2, Vector3d::UnitX())));
  scene.surfaces.push_back({body, Shape::cylinder(r, 0.3), 0});
  tc::Stepper s = scene.stepper();
  run(s, 1);
  const double n = 1 / dt, a = 2.0 / 3.0 * kGravity * std::sin(angle);
  CHECK(position(s, body).dot(slope * Vector3d::UnitX()) ==
        Approx(a * dt * dt * n * (n + 1) / 2).epsilon(1e-9));
}

TEST_CASE("shapes: cylinders, a box, a hull and an ellipsoid rest on each other") {
  Scene scene(2e-3);
  // Boxes of a material of their own: each other they would meet as polyhedra.
  scene.meetings = {{0, 0, 0.6, 0}, {0, 1, 0.6, 0}, {0, 2, 0.6, 0}, {1, 2, 0.6, 0}};
  scene.ground();
  const Matrix3d I = 0.01 * Matrix3d::Identity();
  const auto add = [&](const Shape& shape, const Vector3d& at,
                       const Quaterniond& q = Quaterniond::Identity()) {
    const int i = scene.bodies.add(1, I, at, q);
    const bool polyhedron = shape.kind == tc::ShapeKind::box || shape.kind == tc::ShapeKind::convex;
    scene.surfaces.push_back({i, shape, polyhedron ? 2 : 0});
  };
  // A column: cylinder, box, cylinder, cylinder, flat ellipsoid.
  add(Shape::cylinder(0.2, 0.3), {0, 0, 0.15});
  add(Shape::box({0.5, 0.4, 0.1}), {0.02, 0, 0.35});
  add(Shape::cylinder(0.15, 0.2), {0, 0.02, 0.5});
  add(Shape::cylinder(0.1, 0.2), {0.01, 0, 0.7});
  add(Shape::ellipsoid({0.2, 0.2, 0.1}), {0.01, 0, 0.9});
  // A lying cylinder held between two boxes, and a hull on another one that stands.
  add(Shape::cylinder(0.1, 0.4), {2, 0, 0.1}, Quaterniond(AngleAxisd(kPi / 2, Vector3d::UnitX())));
  add(Shape::box({0.2, 0.5, 0.2}), {1.8, 0, 0.1});
  add(Shape::box({0.2, 0.5, 0.2}), {2.2, 0, 0.1});
  add(Shape::cylinder(0.6, 0.2), {-2, 0, 0.1});
  add(tetrahedron(), {-2, 0, 0.5});
  tc::Stepper s = scene.stepper();
  const std::vector<Vector3d> start = s.bodies().position;
  run(s, 1);
  for (std::size_t i = 0; i < start.size(); ++i) {
    INFO("body " << i);
    CHECK((s.bodies().position[i] - start[i]).norm() < 1e-6);
    CHECK(s.bodies().motion[i].velocity.norm() < 1e-7);
  }
}
