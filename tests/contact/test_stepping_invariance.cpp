// The order and attitude of a scene and effects without strength must change nothing; piles must
// not creep. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

void check_same_bits(const tc::Stepper& a, const tc::Stepper& b) {
  REQUIRE(a.bodies().size() == b.bodies().size());
  bool same = true;
  for (std::size_t i = 0; i < a.bodies().position.size(); ++i) {
    const tc::RigidBody &p = a.bodies().motion[i], &q = b.bodies().motion[i];
    same =
        same && (a.bodies().position[i].array() == b.bodies().position[i].array()).all() &&
        (a.bodies().orientation[i].coeffs().array() == b.bodies().orientation[i].coeffs().array())
            .all() &&
        (p.velocity.array() == q.velocity.array()).all() &&
        (p.angular_velocity.array() == q.angular_velocity.array()).all();
  }
  CHECK(same);
}

// Balls of several sizes that meet, roll, and bounce on a plane.
struct Ball {
  double radius, mass;
  Vector3d at, v, w;
};
const std::array<Ball, 5> kBalls = {{{0.5, 1, {0, 0, 0.5}, {2, 0, 0}, {0, 0, 3}},
                                     {0.3, 0.5, {1.5, 0.05, 0.3}, {0, 0, 0}, {0, 1, 0}},
                                     {0.4, 2, {2.8, -0.1, 0.9}, {-1, 0.1, 0}, {4, 0, 0}},
                                     {0.2, 0.1, {0.1, 0.02, 1.4}, {0, 0, -1}, {0, 0, 0}},
                                     {0.6, 3, {-2, 0.3, 0.6}, {3, -0.1, 0}, {0, 0, -5}}}};

// The scene turned by q, its balls from the first to the last or from the last to the first.
tc::Stepper balls(const Quaterniond& q, bool reversed, double mu, double restitution) {
  Scene scene(1e-3);
  scene.options.tolerance = 1e-13;
  scene.options.gravity = q * Vector3d(0, 0, -kGravity);
  scene.friction(mu, restitution);
  if (!reversed) scene.ground(q * Vector3d::UnitZ());
  for (std::size_t k = 0; k < kBalls.size(); ++k) {
    const Ball& b = kBalls[reversed ? kBalls.size() - 1 - k : k];
    scene.sphere(b.radius, b.mass, q * b.at, q * b.v, q * b.w);
  }
  if (reversed) scene.ground(q * Vector3d::UnitZ());
  return scene.stepper();
}

// Three equal balls on the floor, `apart` between their centres, and one on top. Each lower ball is
// held by friction alone: without a torque both its friction forces are F, and N sin = F (1 + cos)
// for contacts that lean by the angle from the vertical: N = m g / 3, F = N tan(angle / 2).
struct Pile {
  double limit;     // friction between the balls
  double on_floor;  // friction force over normal force at the floor, there
  double moved;
};
Pile pile(double part, double apart, double dt, double seconds) {
  const double r = 0.5, lean = std::asin(apart / std::sqrt(3.0) / (2 * r));
  Pile out{std::tan(lean / 2), std::tan(lean / 2) / 4, 0};
  Scene scene(dt);
  scene.meetings = {{0, 0, out.limit * (1 + part), 0}, {0, 1, 2 * out.on_floor, 0}};
  scene.ground();
  for (int k = 0; k < 3; ++k) {
    const double angle = 0.3 + k * 2 * kPi / 3;
    scene.sphere(
        r, 1,
        {apart / std::sqrt(3.0) * std::cos(angle), apart / std::sqrt(3.0) * std::sin(angle), r});
  }
  scene.sphere(r, 1, {0, 0, r + 2 * r * std::cos(lean)});
  tc::Stepper s = scene.stepper();
  run(s, seconds);
  for (int i = 1; i <= 4; ++i)
    out.moved = std::max(
        out.moved, (position(s, i) - scene.bodies.position[static_cast<std::size_t>(i)]).norm());
  return out;
}

}  // namespace

TEST_CASE("stepping: balls do not depend on the attitude of the scene nor on their order") {
  const double restitution = GENERATE(0.0, 0.6);
  const Quaterniond q = Quaterniond(0.3, -0.8, 0.4, 0.2).normalized();
  tc::Stepper plain = balls(Quaterniond::Identity(), false, 0.4, restitution);
  tc::Stepper turned = balls(q, false, 0.4, restitution);
  tc::Stepper reversed = balls(Quaterniond::Identity(), true, 0.4, restitution);
  long meetings = 0;
  for (int k = 0; k < 1500; ++k) {
    plain.step();
    turned.step();
    reversed.step();
    for (const tc::PointContact& c : plain.contacts().points) meetings += c.second > 0;
  }
  CHECK(meetings > 3);
  const int n = static_cast<int>(kBalls.size());
  for (int k = 0; k < n; ++k) {
    INFO("ball " << k << " restitution " << restitution);
    CHECK((position(turned, k + 1) - q * position(plain, k + 1)).norm() < 1e-9);
    CHECK((velocity(turned, k + 1) - q * velocity(plain, k + 1)).norm() < 1e-9);
    CHECK((position(reversed, n - 1 - k) - position(plain, k + 1)).norm() < 1e-9);
    CHECK((angular_velocity(reversed, n - 1 - k) - angular_velocity(plain, k + 1)).norm() < 1e-8);
  }
}

TEST_CASE("stepping: an effect of no strength, or with nothing to act on, leaves every bit") {
  const auto after = [&](auto change) {
    Scene scene(1e-3);
    scene.friction(0.4);
    scene.ground();
    for (const Ball& b : kBalls) scene.sphere(b.radius, b.mass, b.at, b.v, b.w);
    change(scene);
    tc::Stepper s = scene.stepper();
    run(s, 1);
    return s;
  };
  const tc::Stepper plain = after([](Scene&) {});
  CHECK(plain.counts().contact_problems > 900);
  for (const tc::Gyroscopic g :
       {tc::Gyroscopic::none, tc::Gyroscopic::explicit_step, tc::Gyroscopic::implicit_step})
    check_same_bits(plain, after([&](Scene& s) { s.options.gyroscopic = g; }));
  // A coefficient of restitution whose threshold no approach reaches.
  check_same_bits(plain, after([](Scene& s) {
                    s.friction(0.4, 0.5);
                    s.options.restitution_threshold = 1e9;
                  }));
  // A pair of materials that nobody has.
  check_same_bits(plain, after([](Scene& s) { s.meetings.push_back({2, 3, 1, 1}); }));
  const tc::Stepper icy = after([](Scene& s) { s.friction(0); });
  check_same_bits(icy, after([](Scene& s) { s.options.law = tc::Law::frictionless; }));
  CHECK((velocity(icy, 1) - velocity(plain, 1)).norm() > 1e-3);
  // A force that adds nothing.
  {
    Scene scene(1e-3);
    scene.friction(0.4);
    scene.ground();
    for (const Ball& b : kBalls) scene.sphere(b.radius, b.mass, b.at, b.v, b.w);
    tc::Stepper s = scene.stepper();
    s.add_force("nothing", [](tc::BodySet& bodies, double, double dt) {
      for (tc::RigidBody& b : bodies.motion) b.velocity += dt * Vector3d::Zero();
    });
    run(s, 1);
    check_same_bits(plain, s);
  }
}

TEST_CASE("stepping: four balls in a pile stand iff mu > tan(lean / 2), without creep") {
  for (const double apart : {1.0, 1.1, 1.4})
    for (const double dt : {1e-2, 1e-3}) {
      INFO("apart " << apart << " dt " << dt);
      const Pile stands = pile(1e-3, apart, dt, 5);
      CHECK(stands.moved < 1e-9);
      const Pile falls = pile(-1e-3, apart, dt, 2);
      CHECK(falls.moved > 1e-4);
    }
}
