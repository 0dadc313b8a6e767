// Rolling and torsional friction of bodies that joints hold, in steps. SPDX-License-Identifier:
// BSD-3-Clause
#include <sstream>

#include "jointed_scenes.hpp"
#include "support/catch.hpp"
#include "turned.hpp"

using namespace jointed_scenes;

namespace {

const double kSlope = radians(10), kRadius = 0.2;

// The cart of jointed_scenes.hpp, rolling length c. 14 kg move as 16.
Scene braked(double c, double step) {
  Scene s = cart(0.5, step);
  s.pairs.back().rolling = c;
  return s;
}
double acceleration(double c) {
  return kGravity * 14 / 16 * (std::sin(kSlope) - c / kRadius * std::cos(kSlope));
}

// A foot that spins in a hinge about the vertical on a carriage that slides along it.
Scene spindle(double speed, double torsional) {
  Scene s = stepping(1e-3, Vector3d(0, 0, -kGravity));
  Body carriage = ball("carriage", {0, 0, 0.5}, 3);
  Body foot = ball("foot", {0, 0, 0.1}, 1, 0.02);
  foot.angular_velocity = Vector3d(0, 0, speed);
  touch_sphere(foot, 0.1);
  add(s, carriage);
  add(s, foot);
  s.joints.push_back(joint(JointKind::slider, 0, kWorld, {0, 0, 0.5}));
  s.joints.back().axis = Vector3d::UnitZ();
  s.joints.push_back(hinge(1, 0, {0, 0, 0.3}, Vector3d::UnitZ()));
  add_wall(s, {0, 0, 0}, Vector3d::UnitZ(), 0.3);
  s.pairs.back().torsional = torsional;
  return s;
}

}  // namespace

TEST_CASE("joints and contact: rolling friction brakes a cart by c/r of its weight") {
  const double c = 0.01, step = 1e-3, a = acceleration(c);
  for (const bool turn : {false, true}) {
    const Scene s = braked(c, step);
    const auto engine = make_engine(turn ? turned(s, {1, 2, -3}, 1.1) : s);
    engine->advance(1);
    const double moved =
        (engine->bodies()[0].position - (turn ? turned(s, {1, 2, -3}, 1.1) : s).bodies[0].position)
            .norm();
    CHECK(moved == Approx(a * step * 1001 / 2).epsilon(1e-8));
    CHECK(engine->bodies()[0].velocity.norm() == Approx(a).epsilon(1e-8));
    CHECK(engine->diagnostics().drift < 1e-12);
    CHECK(engine->counts().unsolved == 0);
    // The hinges pull the cart by what its mass needs beside its weight.
    Vector3d pull = Vector3d::Zero();
    for (const JointForce& each : engine->forces().joints) pull += each.force;
    const Vector3d expected = -10 * (a * engine->bodies()[0].velocity.normalized() -
                                     (turn ? turned(s, {1, 2, -3}, 1.1) : s).gravity.value());
    CHECK((pull - expected).norm() < 1e-5 * expected.norm());
  }
}

TEST_CASE("joints and contact: a cart stands on a slope below c/r, and rolls above it") {
  const double least = kRadius * std::tan(kSlope);
  const auto stands = make_engine(braked(1.001 * least, 2e-3));
  stands->advance(1);
  CHECK(stands->bodies()[0].velocity.norm() < 1e-9);
  const auto rolls = make_engine(braked(0.999 * least, 2e-3));
  rolls->advance(1);
  CHECK(rolls->bodies()[0].velocity.x() == Approx(acceleration(0.999 * least)).epsilon(1e-5));
}

TEST_CASE("joints and contact: torsional friction stops a spindle after I w / (d m g)") {
  const double speed = 5, d = 0.01, stop = 0.02 * speed / (d * 4 * kGravity);
  const auto engine = make_engine(spindle(speed, d));
  engine->advance(0.2);
  CHECK(engine->bodies()[1].angular_velocity.z() == Approx(speed * (1 - 0.2 / stop)).epsilon(1e-8));
  engine->advance(0.4);
  CHECK(engine->bodies()[1].angular_velocity.norm() < 1e-10);
  CHECK(engine->bodies()[0].velocity.norm() < 1e-10);
  CHECK(engine->counts().unsolved == 0);
  // Carried by the contact, moment included.
  CHECK(std::abs(total_forces(*engine).contact[1].z() - 4 * kGravity) < 1e-6);
  const auto turning = make_engine(spindle(-speed, d));
  turning->advance(0.1);
  CHECK(total_forces(*turning).contact_moment[1].z() == Approx(d * 4 * kGravity).epsilon(1e-6));
}

TEST_CASE("joints and contact: a ball that nothing joins rolls beside a cart as alone") {
  Scene s = braked(0.01, 1e-3);
  Body loose = ball("loose", {0, 3, 0.3}, 2, 2 * 0.4 * 0.09);
  loose.velocity = Vector3d(1, 0, 0);
  loose.angular_velocity = Vector3d(0, 1 / 0.3, 0);
  touch_sphere(loose, 0.3);
  const int index = add(s, loose);
  const auto engine = make_engine(s);
  engine->advance(0.5);
  const double a = 5.0 / 7 * kGravity * (std::sin(kSlope) - 0.01 / 0.3 * std::cos(kSlope));
  CHECK(engine->bodies()[static_cast<std::size_t>(index)].velocity.x() ==
        Approx(1 + 0.5 * a).epsilon(1e-9));
}

TEST_CASE("joints and contact: rolling friction in parts that keep an accuracy, and restarts") {
  // Thrown up the slope the cart stops after v^2 / 2a and stays: c is above the limit of rest.
  const double c = 1.5 * kRadius * std::tan(kSlope), v = 2;
  const double a = kGravity * 14 / 16 * (std::sin(kSlope) + c / kRadius * std::cos(kSlope));
  for (const double accuracy : {1e-3, 1e-5}) {
    Scene s = braked(c, 0.02);
    s.stepping->accuracy = accuracy;
    for (Body& body : s.bodies)
      if (!body.fixed) body.velocity = Vector3d(-v, 0, 0);
    for (std::size_t k = 1; k <= 4; ++k)
      s.bodies[k].angular_velocity = Vector3d(0, -v / kRadius, 0);
    const auto engine = make_engine(s), again = make_engine(s);
    engine->advance(0.3);
    std::stringstream state;
    engine->save(state);
    again->restore(state);
    for (const auto& each : {engine.get(), again.get()}) each->advance(1.5);
    CHECK(engine->bodies()[0].position == again->bodies()[0].position);
    CHECK(engine->bodies()[3].velocity == again->bodies()[3].velocity);
    INFO("accuracy " << accuracy << ": " << engine->counts().contact_problems << " problems");
    CHECK(std::abs(engine->bodies()[0].position.x() + v * v / (2 * a)) < 10 * accuracy);
    CHECK(engine->bodies()[0].velocity.norm() < 1e-7);
    CHECK(engine->counts().unsolved == 0);
    // Near 1e-5 most accuracies take 3000, a third of them up to a half more.
    CHECK(engine->counts().contact_problems < 4500);
  }
}
