// Stacks, cards and arches: what stands, what falls, and that nothing creeps.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <numeric>

#include "stepping/detection/polyhedra/polyhedra.hpp"
#include "stepping_stacks.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

// Vertical impulse that the layer of contacts at this height carries.
double carried(const tc::Stepper& s, double height) {
  double sum = 0;
  for (std::size_t k = 0; k < s.contacts().points.size(); ++k) {
    const tc::PointContact& c = s.contacts().points[k];
    const double z = s.bodies().position[static_cast<std::size_t>(c.first)].z() + c.r1.z();
    if (std::abs(z - height) < 0.1) sum += std::abs(s.contacts().impulses[k].z());
  }
  return sum;
}

tc::NearPoints points_of(const tc::Shape& a, const tc::Pose& A, const tc::Shape& b,
                         const tc::Pose& B, double margin = 0.01) {
  tc::detail::Polyhedron of_a, of_b;
  if (tc::detail::is_polyhedron(a.kind)) of_a = tc::detail::make_polyhedron(a);
  if (tc::detail::is_polyhedron(b.kind)) of_b = tc::detail::make_polyhedron(b);
  tc::NearPoints out;
  tc::detail::PolyhedraContacts().collide(a, of_a, A, b, of_b, B, margin, out);
  return out;
}

tc::Pose pose(const Vector3d& at, const Quaterniond& q = Quaterniond::Identity()) {
  return {at, q.toRotationMatrix()};
}

}  // namespace

TEST_CASE("polyhedra: faces that touch have four points at round-off, at any attitude") {
  for (int k = 0; k < 20; ++k) {
    const Quaterniond q =
        Quaterniond(std::cos(k + 0.3), std::sin(2.0 * k), std::cos(3.0 * k), std::sin(k * k + 1))
            .normalized();
    const Vector3d at(3, -2, k);
    const double twist = 0.1 * k;
    const Quaterniond upper = q * Quaterniond(AngleAxisd(twist, Vector3d::UnitZ()));
    const tc::NearPoints near =
        points_of(tc::Shape::box({1, 1, 0.5}), pose(at + q * Vector3d(0.1, 0, 0.5), upper),
                  tc::Shape::box({2, 2, 0.5}), pose(at, q));
    REQUIRE(near.count == 4);
    for (int i = 0; i < 4; ++i) {
      CHECK(std::abs(near.point[i].gap) < 2e-15);
      CHECK((near.point[i].normal - q * Vector3d::UnitZ()).norm() < 1e-15);
      CHECK((near.point[i].on_first - near.point[i].on_second).norm() < 5e-15);
    }
  }
}

TEST_CASE("polyhedra: crossing edges, corners, and hulls that are boxes") {
  const double s = std::sqrt(0.5);
  const Quaterniond about_x(AngleAxisd(radians(45), Vector3d::UnitX()));
  const Quaterniond about_y(AngleAxisd(radians(45), Vector3d::UnitY()));
  const tc::Shape cube = tc::Shape::box(Vector3d::Ones());
  for (const double gap : {1e-3, 0.0, -1e-3}) {
    const tc::NearPoints near =
        points_of(cube, pose({0, 0, 2 * s + gap}, about_x), cube, pose({0, 0, 0}, about_y));
    REQUIRE(near.count == 1);
    CHECK(near.point[0].gap == Approx(gap).margin(1e-15));
    CHECK((near.point[0].normal - Vector3d::UnitZ()).norm() < 1e-15);
    CHECK(near.point[0].on_second.head<2>().norm() < 1e-15);
  }
  std::vector<Vector3d> corners;
  for (int k = 0; k < 8; ++k)
    corners.emplace_back((k & 1) != 0 ? 0.5 : -0.5, (k & 2) != 0 ? 0.5 : -0.5,
                         (k & 4) != 0 ? 0.5 : -0.5);
  corners.emplace_back(0.1, 0.2, 0.3);  // inside: no part of the hull
  const tc::Shape hull = tc::Shape::convex(corners);
  const Quaterniond q = Quaterniond(0.9, 0.1, -0.2, 0.3).normalized();
  const tc::NearPoints a =
      points_of(hull, pose(q * Vector3d::UnitZ(), q), cube, pose({0, 0, 0}, q));
  CHECK(a.count == 4);
  for (int i = 0; i < a.count; ++i) CHECK(std::abs(a.point[i].gap) < 1e-15);
  CHECK_THROWS_AS(points_of(tc::Shape::convex({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}),
                            pose({0, 0, 0}), cube, pose({0, 0, 0})),
                  std::invalid_argument);
}

TEST_CASE("polyhedra: capsules and spheres on boxes and hulls") {
  const tc::Shape cube = tc::Shape::box(Vector3d::Ones());
  const Quaterniond lying(AngleAxisd(radians(90), Vector3d::UnitY()));
  const tc::NearPoints flat =
      points_of(tc::Shape::capsule(0.1, 0.6), pose({0, 0, 0.6}, lying), cube, pose({0, 0, 0}));
  REQUIRE(flat.count == 2);
  for (int i = 0; i < 2; ++i) CHECK(std::abs(flat.point[i].gap) < 1e-15);
  // Across an edge.
  const Quaterniond roof(AngleAxisd(radians(45), Vector3d::UnitX()));
  const tc::NearPoints across = points_of(
      tc::Shape::capsule(0.1, 3),
      pose({0, 0, std::sqrt(0.5) + 0.1}, Quaterniond(AngleAxisd(radians(90), Vector3d::UnitX()))),
      cube, pose({0, 0, 0}, roof));
  REQUIRE(across.count == 1);
  CHECK(std::abs(across.point[0].gap) < 1e-15);
  CHECK((across.point[0].normal - Vector3d::UnitZ()).norm() < 1e-15);
}

TEST_CASE("stepping: ten boxes, top mass 1 to 10000, neither sink nor drift in 10 s") {
  const double top = GENERATE(1.0, 100.0, 1000.0, 10000.0);
  const double dt = GENERATE(1e-2, 1e-3);
  if (top > 1 && dt < 1e-2) return;  // the longer step is the harder one, and takes a tenth
  const Scene scene = stack(dt, top);
  tc::Stepper s = scene.stepper();
  double lost = 0, drift = 0;
  const long n = std::lround(10 / dt);
  for (long k = 0; k < n; ++k) {
    s.step();
    for (int i = 1; i <= 10; ++i) {
      const double below = i == 1 ? -0.5 : position(s, i - 1).z();
      lost = std::max(lost, std::abs(position(s, i).z() - below - 1));
      drift = std::max(drift, position(s, i).head<2>().norm());
    }
  }
  INFO("top " << top << " dt " << dt << " lost " << lost << " drift " << drift);
  CHECK(lost < 1e-9);
  CHECK(drift < 1e-8);
  CHECK(s.counts().unsolved == 0);
  for (int level = 0; level < 10; ++level) {
    const double weight = (9 - level + top) * kGravity * dt;
    CHECK(carried(s, level) == Approx(weight).epsilon(1e-7));
  }
}

TEST_CASE("stepping: card house of 15 stands at mu = 0.25 and falls at 0.22") {
  {
    const double dt = 1e-2;
    const Scene scene = card_house(dt, 0.25);
    REQUIRE(scene.bodies.size() == 16);
    tc::Stepper s = scene.stepper();
    s.step();
    CHECK(largest_speed(s) < 1e-7 * kGravity * dt);
    run(s, 10 - dt);
    INFO("moved " << largest_move(s, scene.bodies));
    CHECK(largest_move(s, scene.bodies) < 1e-7);
  }
  {
    const Scene scene = card_house(1e-3, 0.25);
    tc::Stepper s = scene.stepper();
    run(s, 10);
    CHECK(largest_move(s, scene.bodies) < 1e-7);
  }
  {
    Scene scene = card_house(1e-2, 0.22);
    scene.options.tolerance = 1e-7;  // falling cards: exact answers are not needed
    tc::Stepper s = scene.stepper();
    run(s, 1);
    CHECK(position(s, 15).z() < scene.bodies.position[15].z() - 0.1);
  }
}

TEST_CASE("stepping: the limit of the card house lies at mu = 0.2376") {
  for (const double part : {-0.01, 0.01}) {
    const double dt = 1e-2;
    tc::Stepper s = card_house(dt, 0.2376138 * (1 + part)).stepper();
    s.step();
    CHECK((largest_speed(s) < 1e-7 * kGravity * dt) == (part > 0));
  }
}

TEST_CASE("stepping: a stack does not depend on the order of its boxes nor on its heading") {
  const double dt = 1e-2;
  const int n = 6;
  const Quaterniond turn(AngleAxisd(0.7, Vector3d::UnitZ()));
  for (const bool turned : {false, true}) {
    Scene scene(dt);
    scene.friction(0.5);
    scene.ground();
    for (int k = 0; k < n; ++k) {
      const int level = k * 5 % n;
      const Vector3d at(0.01 * level, 0, level + 0.5 + 0.05 * (level + 1));  // dropped
      scene.box(Vector3d::Ones(), 1 + level, turned ? Vector3d(turn * at) : at,
                turned ? turn : Quaterniond::Identity());
    }
    Scene plain(dt);
    plain.friction(0.5);
    plain.ground();
    for (int level = 0; level < n; ++level)
      plain.box(Vector3d::Ones(), 1 + level,
                Vector3d(0.01 * level, 0, level + 0.5 + 0.05 * (level + 1)));
    tc::Stepper a = scene.stepper(), b = plain.stepper();
    run(a, 0.5);
    run(b, 0.5);
    double difference = 0;
    for (int k = 0; k < n; ++k) {
      const Vector3d expected = position(b, 1 + k * 5 % n);
      difference =
          std::max(difference,
                   (position(a, 1 + k) - (turned ? Vector3d(turn * expected) : expected)).norm());
    }
    CHECK(difference < 1e-7);
  }
}

TEST_CASE("polyhedra: two edges side by side touch at both ends, at any small angle and size") {
  // Two cards lean on each other, turned about the vertical: the edges meet at one end and are
  // apart at the other.
  const double lean = radians(15);
  for (const double size : {1e-3, 1.0, 1e4})
    for (const double yaw : {0.0, 1e-9, 1e-6, 3e-5, 1e-4, 1e-3, 1e-2}) {
      const tc::Shape card = tc::Shape::box(size * Vector3d(0.02, 0.7, 1));
      const auto leaning = [&](double side) {
        const Quaterniond q = AngleAxisd(-side * yaw, Vector3d::UnitZ()) *
                              AngleAxisd(-side * lean, Vector3d::UnitY());
        const double reach = 0.01 * std::cos(lean) + 0.5 * std::sin(lean);
        return pose(size * Vector3d(side * reach, 0, 0), q);
      };
      const tc::NearPoints near = points_of(card, leaning(-1), card, leaning(1), 0.01 * size);
      CAPTURE(size, yaw);
      REQUIRE(near.count == 2);
      const double apart = 0.7 * std::sin(yaw);  // half of the length, twice the angle
      const auto [least, most] = std::minmax(near.point[0].gap, near.point[1].gap);
      CHECK(least == Approx(-apart * size).margin((0.3 * yaw * yaw + 1e-14) * size));
      CHECK(most == Approx(apart * size).margin((0.3 * yaw * yaw + 1e-14) * size));
      CHECK(std::abs(near.point[0].normal.x()) > 0.999);
      CHECK(std::abs(near.point[0].on_first.y() - near.point[1].on_first.y()) > 0.69 * size);
    }
}

TEST_CASE("polyhedra: beside two edges that cross, what may close meanwhile is a contact") {
  // The upper box, tilted about a slanted axis, meets the rim of the lower one with an edge. It
  // turns about that point by more than its tilt in a step, and may go no deeper than it is.
  const Vector3d size(0.2, 0.15, 0.1);
  int crossing = 0;
  for (int k = 0; k < 200; ++k) {
    Scene scene(5e-3);
    scene.options.gravity.reset();
    scene.options.error_reduction = 0;
    scene.friction(0.3);
    const Quaterniond q(AngleAxisd(0.06, Vector3d(std::cos(k), std::sin(k), 0.3).normalized()));
    scene.surfaces.push_back({scene.bodies.add_fixed(Vector3d::Zero()), tc::Shape::box(size), 1});
    const int box =
        scene.box(size, 1, Vector3d(0.11 * std::cos(7 * k), 0.08 * std::sin(7 * k), 0.107), q);
    const Vector3d w(20 * std::sin(3 * k), 20 * std::cos(5 * k), 0);
    scene.bodies.motion[static_cast<std::size_t>(box)].angular_velocity = w;
    tc::Stepper s = scene.stepper();
    s.step();
    const double before = s.penetration();
    if (s.contacts().points.size() > 0 && before == 0) ++crossing;
    double deepest = 0;
    s.step();
    deepest = s.penetration();
    CAPTURE(k, before, deepest);
    CHECK(deepest < before + 1e-3);
  }
  CHECK(crossing > 50);
}

TEST_CASE(
    "polyhedra: places beside which a size is lost, and places that are no numbers, are safe") {
  // A margin is as long as a step's way: of a body that somebody has thrown with 1e30 m/s.
  const tc::Shape box = tc::Shape::box({1, 1, 0.5});
  const Quaterniond turned(AngleAxisd(1e28, Vector3d(1, 2, 3).normalized()));
  for (const double far : {1e10, 1e17, 1e30, 1e150, 1e300})
    for (const Vector3d& way : {Vector3d(1, 0, 0), Vector3d(0, 0, -1), Vector3d(3, 2, 1)})
      for (const Quaterniond& q : {Quaterniond::Identity(), turned}) {
        CAPTURE(far, way.transpose());
        const tc::NearPoints near =
            points_of(box, pose(Vector3d::Zero()), box, pose(far * way, q), 1e305);
        if (way.norm() == 1 && q.w() == 1) CHECK(near.count > 0);
        for (int k = 0; k < near.count; ++k) CHECK(near.point[k].gap > 0.5 * far);
      }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(points_of(box, pose(Vector3d::Zero()), box, pose({0, nan, 0})).count == 0);
  CHECK(points_of(box, pose({nan, nan, nan}), box, pose(Vector3d::Zero())).count == 0);
}
