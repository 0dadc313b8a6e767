// The stepping engine of scenes. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tether/scene/engine.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "support/catch.hpp"

namespace {

using namespace tether::scene;
using Eigen::Vector3d;

Body ball(const std::string& name, double radius, const Vector3d& at,
          const Vector3d& v = Vector3d::Zero()) {
  Body b;
  b.name = name;
  b.mass = 1;
  b.inertia = 0.4 * radius * radius * Eigen::Matrix3d::Identity();
  b.position = at;
  b.velocity = v;
  b.material = "stone";
  Shape s;
  s.kind = ShapeKind::sphere;
  s.radius = radius;
  b.shapes = {s};
  return b;
}

Body floor_body() {
  Body b;
  b.name = "floor";
  b.fixed = true;
  b.material = "floor";
  Shape s;
  s.kind = ShapeKind::plane;
  b.shapes = {s};
  return b;
}

Scene balls_on_floor(double friction = 0.3, double restitution = 0) {
  Scene scene;
  scene.name = "balls";
  scene.gravity = Vector3d(0, 0, -9.81);
  scene.bodies = {floor_body(), ball("a", 0.5, {0, 0, 0.5}, {7, 0, 0}),
                  ball("b", 0.5, {3, 0.1, 1.5}), ball("c", 0.5, {3, 0, 0.5})};
  scene.pairs = {{"stone", "floor", friction, restitution, {}},
                 {"stone", "stone", friction, restitution, {}}};
  scene.stepping = SteppingOptions{};
  return scene;
}

void check_same_bits(const Engine& a, const Engine& b) {
  CHECK(a.time() == b.time());
  for (std::size_t i = 0; i < a.bodies().size(); ++i) {
    CHECK((a.bodies()[i].position.array() == b.bodies()[i].position.array()).all());
    CHECK((a.bodies()[i].velocity.array() == b.bodies()[i].velocity.array()).all());
    CHECK((a.bodies()[i].angular_velocity.array() == b.bodies()[i].angular_velocity.array()).all());
    CHECK((a.bodies()[i].orientation.coeffs().array() == b.bodies()[i].orientation.coeffs().array())
              .all());
  }
}

std::string effects(const Engine& e) {
  std::string all;
  for (const EffectCost& c : e.costs()) all += c.effect + ",";
  return all;
}

}  // namespace

TEST_CASE("stepping engine: a restored run goes on with the same bits") {
  const Scene scene = balls_on_floor(0.3, 0.4);
  const auto a = make_stepping_engine(scene);
  a->advance(0.7);
  std::stringstream state;
  a->save(state);
  const auto b = make_stepping_engine(scene);
  b->restore(state);
  check_same_bits(*a, *b);
  a->advance(1.5);
  b->advance(1.5);
  check_same_bits(*a, *b);
  CHECK(a->diagnostics().contacts > 0);
  CHECK(a->contacts().size() == static_cast<std::size_t>(a->diagnostics().contacts));
}

TEST_CASE("stepping engine: states that are damaged or of another scene are refused") {
  const auto a = make_stepping_engine(balls_on_floor());
  std::stringstream saved;
  a->save(saved);
  const std::string state = saved.str();
  for (std::size_t length : {std::size_t{0}, std::size_t{7}, state.size() / 2, state.size() - 1}) {
    std::istringstream cut(state.substr(0, length));
    CHECK_THROWS_AS(a->restore(cut), std::runtime_error);
  }
  Scene other = balls_on_floor();
  other.stepping->step = 2e-3;
  const auto b = make_stepping_engine(other);
  std::istringstream whole(state);
  CHECK_THROWS_WITH(b->restore(whole), Catch::Contains("another scene"));
}

TEST_CASE("stepping engine: a state with a number that is not finite is refused") {
  const Scene scene = balls_on_floor();
  const auto a = make_stepping_engine(scene);
  std::stringstream saved;
  a->save(saved);
  const std::string state = saved.str();
  const std::size_t head = 8 + 3 * 8, numbers = scene.bodies.size() * 13;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t k = 0; k < numbers; ++k) {
    INFO(k);
    std::string bad = state;
    bad.replace(head + 8 * k, 8, reinterpret_cast<const char*>(&nan), 8);
    std::istringstream in(bad);
    CHECK_THROWS_AS(a->restore(in), std::runtime_error);
  }
}

TEST_CASE("stepping engine: a state that presses bodies which are not there is refused") {
  const Scene scene = balls_on_floor();
  const auto a = make_stepping_engine(scene);
  a->advance(0.05);
  REQUIRE(!a->contacts().empty());
  std::stringstream saved;
  a->save(saved);
  const std::string state = saved.str();
  // The contacts of the last step stand before its outcome, no vibration of joints, an empty sleep
  // and cuts: two bodies, friction, bias, number, three vectors; gap; impulse.
  const std::size_t outcome = 8 + 8 + 4 + 5 * 8 + 3 * 8 + 3 * 8 + 8,
                    contact = 2 * 4 + 3 * 8 + 9 * 8 + 8 + 3 * 8;
  const std::size_t first = state.size() - outcome - contact, second = first + 4;
  const auto restored_with = [&](std::size_t place, std::int32_t body) {
    std::string changed = state;
    changed.replace(place, 4, reinterpret_cast<const char*>(&body), 4);
    std::istringstream in(changed);
    a->restore(in);
  };
  const auto bodies = static_cast<std::int32_t>(scene.bodies.size());
  restored_with(first, a->contacts().back().first);  // this is the place
  restored_with(second, a->contacts().back().second);
  restored_with(second, -1);  // the world
  for (const std::int32_t body : {-2, bodies, bodies + 1, 2147483647}) {
    INFO(body);
    CHECK_THROWS_WITH(restored_with(first, body), Catch::Contains("contacts of no bodies"));
    CHECK_THROWS_WITH(restored_with(second, body), Catch::Contains("contacts of no bodies"));
  }
  CHECK_THROWS_WITH(restored_with(first, -1), Catch::Contains("contacts of no bodies"));
}

TEST_CASE("stepping engine: a state of another format is refused by name") {
  const auto engine = make_stepping_engine(balls_on_floor());
  std::stringstream saved;
  engine->save(saved);
  std::string state = saved.str();
  REQUIRE(state[7] == '9');
  for (const char other : {'6', '8'}) {
    state[7] = other;
    std::istringstream in(state);
    CHECK_THROWS_WITH(engine->restore(in), Catch::Contains(std::string("format ") + other));
  }
}

TEST_CASE("stepping engine: springs, dampers, loads and drag") {
  const double dt = GENERATE(1e-3, 1e-4);
  Scene scene;
  scene.stepping = SteppingOptions{};
  scene.stepping->step = dt;
  scene.bodies = {ball("spring", 0.1, {1.5, 0, 0}), ball("load", 0.1, {0, 5, 0}),
                  ball("drag", 0.1, {0, 9, 0}, {2, 0, 0})};
  scene.bodies[0].position = {1.5, 0, 0};
  Spring spring;
  spring.first = 0;
  spring.at = {1.5, 0, 0};
  spring.at_second = Vector3d::Zero();
  spring.rest = 1;
  spring.stiffness = 40;
  spring.damping = 1;
  scene.springs = {spring};
  Load load;
  load.body = 1;
  load.force = {0, 0, 3};
  load.torque = {0, 0.02, 0};
  scene.loads = {load};
  scene.bodies[2].drag = Drag{0.5, 0, 0};
  const auto e = make_stepping_engine(scene);
  CHECK(effects(*e) == "springs,loads,drag,motion,");
  CHECK(e->diagnostics().potential_energy == Approx(0.5 * 40 * 0.25));
  e->advance(1);
  // Damped oscillator, m = 1, k = 40, c = 1.
  const double gamma = 0.5, omega = std::sqrt(40 - gamma * gamma);
  const double x = 1 + 0.5 * std::exp(-gamma) * (std::cos(omega) + gamma / omega * std::sin(omega));
  CHECK(e->bodies()[0].position.x() == Approx(x).margin(3 * dt));
  CHECK(e->bodies()[1].velocity.z() == Approx(3).epsilon(1e-12));
  CHECK(e->bodies()[1].position.z() == Approx(1.5 * (1 + dt)).epsilon(1e-10));
  CHECK(e->bodies()[1].angular_velocity.y() == Approx(0.02 / 0.004).epsilon(1e-12));
  CHECK(e->bodies()[2].velocity.x() == Approx(2 * std::exp(-0.5)).epsilon(0.3 * dt));
  scene.springs[0].stiffness = 1e9;
  CHECK_THROWS_WITH(make_stepping_engine(scene), Catch::Contains("too long"));
}

TEST_CASE("stepping engine: what is named with zero strength equals what is not named") {
  const auto a = make_stepping_engine(balls_on_floor(0, 0));
  Scene frictionless = balls_on_floor(0.3, 0);
  frictionless.stepping->law = tether::contact::Law::frictionless;
  const auto b = make_stepping_engine(frictionless);
  a->advance(1);
  b->advance(1);
  check_same_bits(*a, *b);

  Scene still = balls_on_floor();
  still.gravity = Vector3d::Zero();
  Scene none = balls_on_floor();
  none.gravity.reset();
  const auto c = make_stepping_engine(still), d = make_stepping_engine(none);
  c->advance(0.5);
  d->advance(0.5);
  check_same_bits(*c, *d);
  CHECK(effects(*c) == "collision,gravity,contact,penetration,motion,");
  CHECK(effects(*d) == "collision,contact,penetration,motion,");

  // Springs without stiffness, loads and drags of nothing: named, and in the list.
  Scene idle = balls_on_floor();
  Spring spring;
  spring.first = 1;
  spring.second = 2;
  spring.at = idle.bodies[1].position;
  spring.at_second = idle.bodies[2].position;
  idle.springs = {spring};
  Load load;
  load.body = 1;
  idle.loads = {load};
  idle.bodies[1].drag = Drag{};
  const auto e = make_stepping_engine(idle), f = make_stepping_engine(balls_on_floor());
  e->advance(1);
  f->advance(1);
  check_same_bits(*e, *f);
  CHECK(effects(*e) == "collision,gravity,springs,loads,drag,contact,penetration,motion,");

  Scene apart = balls_on_floor();
  apart.pairs.clear();
  CHECK(effects(*make_stepping_engine(apart)) == "gravity,motion,");
}

TEST_CASE("stepping engine: what it does not have is refused by name") {
  Scene scene = balls_on_floor();
  Joint joint;
  joint.first = 1;
  scene.joints = {joint};
  CHECK_NOTHROW(make_stepping_engine(scene));
  scene.joints.clear();
  scene.invariants = {Invariant{}};
  CHECK_THROWS_WITH(make_stepping_engine(scene), Catch::Contains("invariants"));
  scene.invariants[0].project = false;
  CHECK_NOTHROW(make_stepping_engine(scene));
  scene.bodies[1].mass = 0;
  CHECK_THROWS_WITH(make_stepping_engine(scene), Catch::Contains("body \"a\""));
}

TEST_CASE("stepping engine: ends at the first step boundary not before the time asked for") {
  Scene scene = balls_on_floor();
  scene.stepping->step = 1e-2;
  const auto e = make_stepping_engine(scene);
  for (int k = 1; k <= 100; ++k) {
    e->advance(0.01 * k);
    REQUIRE(e->counts().steps == k);
  }
  e->advance(1.001);
  CHECK(e->counts().steps == 101);
  e->advance(1.0);
  CHECK(e->counts().steps == 101);
}

TEST_CASE("stepping engine: steps in parts end where a block on a spring turns") {
  // x'' + x = -0.15 sgn x' from 1 m: turns at k pi, at -0.7, 0.4 and -0.1 m. Without cuts at the
  // turns it was 2.2e-3 and 2.8e-4 m off, for 720 and 5616 problems.
  const double turns[] = {1, -0.7, 0.4};
  struct Case {
    double accuracy, error;
    long problems;
  };
  for (const Case& c : {Case{1e-3, 1e-3, 760}, Case{1e-5, 3e-5, 5800}}) {
    CAPTURE(c.accuracy);
    Scene scene = parse_scene(R"(
[scene]
end = 9
gravity = [0, 0, -10]
[stepping]
step = 0.09
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "floor"
[[body]]
name = "block"
shape = "box"
size = [0.4, 0.4, 0.2]
mass = 1
material = "block"
position = [1, 0, 0.1]
[[pair]]
between = ["floor", "block"]
friction = 0.015
[[spring]]
bodies = ["block", "world"]
at = [[1, 0, 0.1], [-15, 0, 0.1]]
stiffness = 1
rest = 15
)",
                              "turns.toml");
    scene.stepping->accuracy = c.accuracy;
    const auto engine = make_engine(scene);
    double error = 0;
    for (int k = 1; k <= 10; ++k) {
      engine->advance(0.9 * k);
      const int half = static_cast<int>(0.9 * k / M_PI);
      const double middle = turns[half] > 0 ? 0.15 : -0.15;
      const double x = middle + (turns[half] - middle) * std::cos(0.9 * k - half * M_PI);
      error = std::max(error, std::abs(engine->bodies()[1].position.x() - x));
    }
    CHECK(error < c.error);
    CHECK(engine->counts().contact_problems < c.problems);
  }
}
