// Cards, arches, wedges and dominoes: limits of friction and speeds with known values.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <tether/linalg/index.hpp>

#include "stepping_stacks.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

using tether::linalg::at;

// Dominoes with frictionless, inelastic sides on a floor without slip, the first one pushed. Speed
// of the wave between two of them, over sqrt(g h).
double train(double height, double thickness, double gap, double dt) {
  const int n = 24, from = 14, to = 22;
  Scene scene(dt);
  scene.options.tolerance = 1e-6;
  scene.meetings = {{0, 0, 0, 0}, {0, 1, 10, 0}};
  scene.ground();
  const double pitch = gap + thickness;
  for (int k = 0; k < n; ++k)
    scene.box({thickness, 0.5 * height, height}, 1, {k * pitch, 0, height / 2});
  const Vector3d w(0, 1.5 * std::sqrt(kGravity / height), 0);
  scene.bodies.motion[1].angular_velocity = w;
  scene.bodies.motion[1].velocity = w.cross(Vector3d(-thickness / 2, 0, height / 2));
  tc::Stepper s = scene.stepper();
  std::array<double, 2> passed = {0, 0};
  std::array<double, 2> turned = {0, 0};
  const double mark = 0.02;
  double energy = 1e300;
  while (passed[1] == 0 && s.time() < 20) {
    s.step();
    double now = tc::kinetic_energy(s.bodies());
    for (const Vector3d& p : s.bodies().position) now += kGravity * p.z();
    double fall = 0;
    for (const tc::RigidBody& b : s.bodies().motion) fall += std::abs(b.velocity.z());
    // Taking a penetration back may lift as many as lean on each other.
    const double lift = n * scene.options.error_reduction * s.penetration();
    CHECK(now <= energy + kGravity * (dt * fall + lift) + 1e-9);
    energy = now;
    int which = 0;
    for (const int k : {from, to}) {
      const double angle =
          s.bodies().orientation[at(1 + k)].angularDistance(Quaterniond::Identity());
      if (passed[at(which)] == 0 && angle > mark)
        passed[at(which)] =
            s.time() - dt * (angle - mark) / std::max(angle - turned[at(which)], 1e-300);
      turned[at(which++)] = angle;
    }
  }
  return (to - from) * pitch / (passed[1] - passed[0]) / std::sqrt(kGravity * height);
}

}  // namespace

TEST_CASE("stepping: two leaning cards stand for mu > tan(lean)/2 - t/(2 L)") {
  for (const double lean : {15.0, 25.0}) {
    const double limit = std::tan(radians(lean)) / 2 - 0.02 / 2;
    CHECK(stands(card_house(1e-2, limit * 1.01, 1, lean)));
    CHECK_FALSE(stands(card_house(1e-2, limit * 0.99, 1, lean)));
  }
  const Scene scene = card_house(1e-3, 0.5, 1, 25);
  tc::Stepper s = scene.stepper();
  run(s, 2);
  CHECK(largest_move(s, scene.bodies) < 1e-9);
  const Scene slippery = card_house(1e-3, 0.22, 1, 25);
  tc::Stepper t = slippery.stepper();
  run(t, 1);
  CHECK(largest_move(t, slippery.bodies) > 1e-3);
}

TEST_CASE("stepping: an icy wedge between two walls presses with m g / (2 sin(half angle))") {
  const double half = GENERATE(0.2, 0.5, 1.0), dt = 1e-2;
  Scene scene(dt);
  scene.friction(0);
  scene.bodies.add_fixed(Vector3d::Zero());
  for (const double side : {-1.0, 1.0})
    scene.surfaces.push_back({0, tc::Shape::plane({side * std::cos(half), 0, std::sin(half)}), 1});
  const double l = 1;  // its edges lie on the walls
  std::vector<Vector3d> corners;
  for (const double y : {-0.5, 0.5})
    for (const Vector3d& p :
         {Vector3d(-l * std::sin(half), y, l * std::cos(half)), Vector3d(0, y, 0),
          Vector3d(l * std::sin(half), y, l * std::cos(half))})
      corners.push_back(p - Vector3d(0, 0, 2.0 / 3 * l * std::cos(half)));
  const int wedge =
      scene.bodies.add(2, Matrix3d::Identity() * 0.1, {0, 0, 2.0 / 3 * l * std::cos(half)});
  scene.surfaces.push_back({wedge, tc::Shape::convex(corners), 0});
  tc::Stepper s = scene.stepper();
  run(s, 1);
  CHECK(largest_move(s, scene.bodies) < 1e-9);
  double left = 0, right = 0;
  for (std::size_t k = 0; k < s.contacts().points.size(); ++k) {
    const Vector3d& p = s.contacts().impulses[k];
    (p.x() > 0 ? left : right) += p.norm();
  }
  const double force = 2 * kGravity / (2 * std::sin(half));
  CHECK(left / dt == Approx(force).epsilon(1e-8));
  CHECK(right / dt == Approx(force).epsilon(1e-8));
}

namespace {

// Eight rows of eight bricks, half of one off in every other row.
Scene wall(double dt) {
  Scene scene(dt);
  scene.friction(0.6);
  scene.ground();
  for (int row = 0; row < 8; ++row)
    for (int k = 0; k < 8; ++k)
      scene.box({0.4, 0.2, 0.2}, 32, {0.4 * k + 0.2 * (row % 2), 0, 0.1 + 0.2 * row});
  scene.options.acceptance = 1e5;
  scene.options.max_halvings = 2;
  return scene;
}

}  // namespace

// 676 contacts. What one step leaves above the tolerance would be gaps and slips in the next ones.
TEST_CASE("stepping: a wall stands, every problem solved") {
  tc::Stepper s = wall(2e-3).stepper();
  run(s, 0.02);
  CHECK(s.counts().accepted == 0);
  CHECK(s.counts().halved == 0);
  for (int i = 1; i <= 64; ++i) CHECK(velocity(s, i).norm() < 1e-9);
}

TEST_CASE("stepping: a wall is hit, no problem above what is accepted") {
  Scene scene = wall(2e-3);
  const int ball = scene.sphere(0.2, 261, {1.6, -0.31, 0.8}, {0, 8, 0});
  tc::Stepper s = scene.stepper();
  run(s, 0.008);
  CHECK(velocity(s, ball).y() < 7);
  CHECK(s.counts().unsolved == 0);
  CHECK(s.counts().halved <= 1);
  CHECK(s.residual() <= 1e-4);
}

TEST_CASE("stepping: dominoes fall as fast as the chain of one freedom says") {
  // A chain of one freedom with plastic impacts. Time steps in units of sqrt(h / 1 m).
  struct Case {
    double height, thickness, gap, speed, step;  // m, m, m, sqrt(g h), s
  };
  const Case c =
      GENERATE(Case{1, 0.15, 0.3, 1.8403, 4e-3}, Case{1, 0.15, 0.5, 1.6979, 8e-3},
               Case{0.048, 0.0075, 0.02, 1.7455, 8e-3}, Case{1, 0.02, 0.5, 1.6877, 4e-3});
  const double speed = train(c.height, c.thickness, c.gap, c.step * std::sqrt(c.height));
  INFO("h " << c.height << " thickness " << c.thickness << " gap " << c.gap << " speed " << speed);
  CHECK(speed == Approx(c.speed).epsilon(0.02));
}
