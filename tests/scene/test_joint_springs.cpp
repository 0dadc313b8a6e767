// Springs, dampers and drives at joints. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "engines_of_texts.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;
using Eigen::Vector3d;

namespace {

constexpr EngineKind kSmoothOnes[] = {EngineKind::smooth, EngineKind::event};

// x of m x'' + c x' + k x = 0.
double oscillation(double m, double c, double k, double x0, double v0, double t) {
  const double d = c / m / 2, w = std::sqrt(k / m - d * d);
  return std::exp(-d * t) * (x0 * std::cos(w * t) + (v0 + d * x0) / w * std::sin(w * t));
}

const std::string kWheels = R"(
[scene]
end = 2
[[body]]
name = "wheel"
mass = 2
inertia = [0.5, 0.5, 0.4]
[[body]]
name = "carriage"
mass = 2
inertia = [0.1, 0.1, 0.1]
[[body]]
name = "servo"
mass = 2
inertia = [0.5, 0.5, 0.4]
[[body]]
name = "driven"
mass = 2
inertia = [0.5, 0.5, 0.4]
[[body]]
name = "globe"
mass = 2
inertia = [0.4, 0.4, 0.4]
angular_velocity = [2.4, 3.2, 0]
[[joint]]
kind = "hinge"
bodies = ["wheel", "world"]
at = [0, 0, 0]
axis = [0, 0, 1]
spring = { stiffness = 10, damping = 0.4, rest_deg = 60 }
[[joint]]
kind = "slider"
bodies = ["world", "carriage"]
axis = [-1, 0, 0]
spring = { stiffness = 50, damping = 2, rest = 0.1 }
[[joint]]
kind = "hinge"
bodies = ["servo", "world"]
at = [0, 0, 0]
axis = [0, 0, 1]
motor = { stiffness = 40, damping = 8, target_deg = 90, rate_rad = 0.3 }
[[joint]]
kind = "hinge"
bodies = ["driven", "world"]
at = [0, 0, 0]
axis = [0, 0, 1]
motor = { rate_rad = 5, damping = 2, torque = 3 }
[[joint]]
kind = "ball"
bodies = ["globe", "world"]
at = [0, 0, 0]
spring = { stiffness = 10, damping = 0.4 }
)";

double turn(const BodyState& body, const Vector3d& axis) {
  return 2 * std::atan2(axis.dot(body.orientation.vec()), body.orientation.w());
}

// The largest error of the wheels against their closed forms.
double error_of_wheels(const Engine& engine) {
  const double t = engine.time();
  const auto& b = engine.bodies();
  const double wheel = M_PI / 3 + oscillation(0.4, 0.4, 10, -M_PI / 3, 0, t);
  const double carriage = 0.1 + oscillation(2, 2, 50, -0.1, 0, t);
  // Critical, w = 10 1/s: the lag starts at 90 degrees and at 0.3 rad/s.
  const double lag = (M_PI / 2 + (0.3 + 10 * M_PI / 2) * t) * std::exp(-10 * t);
  const double servo = M_PI / 2 + 0.3 * t - lag;
  const double saturated = 0.4 * 3.5 / 3;
  const double speed = t < saturated ? 7.5 * t : 5 - 1.5 * std::exp(-5 * (t - saturated));
  const double globe = oscillation(0.4, 0.4, 10, 0, 4, t);
  return std::max(
      {std::abs(turn(b[0], Vector3d::UnitZ()) - wheel), std::abs(b[1].position.x() - carriage),
       std::abs(turn(b[2], Vector3d::UnitZ()) - servo), std::abs(b[3].angular_velocity.z() - speed),
       std::abs(turn(b[4], Vector3d(0.6, 0.8, 0)) - globe)});
}

// A flywheel pair that floats, or its like on a ball, out of line with both centres.
std::string floating(const std::string& joint) { return two_bodies("3", "[0.5, -0.4, 1]", joint); }

}  // namespace

TEST_CASE("springs, dampers and drives of joints keep their closed forms by tolerance") {
  const Scene scene = scene_of(kWheels);
  CHECK(make_plan(scene).engine == EngineKind::smooth);
  for (const EngineKind kind : kSmoothOnes)
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const auto engine = engine_of(scene, kind, tolerance);
      for (const double t : {0.3, 1.0, 2.0}) {
        engine->advance(t);
        INFO(static_cast<int>(kind) << " " << tolerance << " " << t);
        CHECK(error_of_wheels(*engine) < 30 * tolerance);
      }
      // Forces: 10 N m/rad and 0.4 N m s on the wheel.
      const BodyState& wheel = engine->bodies()[0];
      const double expected =
          -10 * (turn(wheel, Vector3d::UnitZ()) - M_PI / 3) - 0.4 * wheel.angular_velocity.z();
      const Forces forces = engine->forces();
      CHECK(std::abs(forces.joints[0].drive - expected) < 1e-6);
      CHECK((forces.joints[4].moment +
             10 * turn(engine->bodies()[4], Vector3d(0.6, 0.8, 0)) * Vector3d(0.6, 0.8, 0) +
             0.4 * engine->bodies()[4].angular_velocity)
                .norm() < 1e-6);
    }
}

TEST_CASE("springs, dampers and drives of joints in steps are of order 1") {
  Scene scene = scene_of(kWheels);
  double last = 0;
  for (const double step : {1e-2, 1e-3, 1e-4}) {
    scene.stepping.emplace().step = step;
    const auto engine = make_engine(scene);
    engine->advance(0.3);
    double error = error_of_wheels(*engine);
    engine->advance(1);
    error = std::max(error, error_of_wheels(*engine));
    INFO(step << " " << error);
    CHECK(error < 20 * step);
    if (last > 0) CHECK((last / error > 7 && last / error < 13));
    last = error;
  }
}

TEST_CASE("springs of joints between floating bodies keep energy and momenta") {
  for (const char* joint :
       {"kind = \"ball\"\nat = [0.4, 0, 0.1]\nspring = { stiffness = 6 }",
        "kind = \"hinge\"\nat = [0.4, 0, 0.1]\naxis = [0, 1, 1]\nspring = { stiffness = 6, "
        "rest_deg = 40 }",
        "kind = \"slider\"\naxis = [0, 1, 1]\nspring = { stiffness = 6, rest = -0.3 }"})
    for (const EngineKind kind : kSmoothOnes) {
      const auto engine = engine_of(scene_of(floating(joint)), kind, 1e-10);
      const Diagnostics start = engine->diagnostics();
      engine->advance(3);
      const Diagnostics end = engine->diagnostics();
      INFO(joint << " " << static_cast<int>(kind));
      CHECK(std::abs(end.kinetic_energy + end.potential_energy - start.kinetic_energy -
                     start.potential_energy) < 1e-8);
      CHECK((end.momentum - start.momentum).norm() < 1e-8);
      CHECK((end.angular_momentum - start.angular_momentum).norm() < 1e-8);
      CHECK(std::abs(end.potential_energy - start.potential_energy) > 1e-3);
    }
}

TEST_CASE("energy is kept with the work of joint dampers and drives counted, in every form") {
  Scene scene = scene_of(kWheels);
  scene.invariants.emplace_back();
  scene.invariants.back().kind = InvariantKind::energy;
  for (const Formulation form : {Formulation::index1, Formulation::index0}) {
    scene.smooth.emplace().tolerance = 1e-8;
    scene.smooth->formulation = form;
    const auto engine = make_engine(scene);
    engine->advance(2);
    CHECK(error_of_wheels(*engine) < 1e-6);
  }
}

TEST_CASE("gains of any size are stable at any step, alone and against a wall") {
  for (const double gain : {1e2, 1e6, 1e12})
    for (const double step : {1e-3, 1e-1}) {
      Scene scene = scene_of(R"(
[scene]
end = 40
gravity = [0, 0, -9.81]
[stepping]
[[body]]
name = "wall"
shape = "plane"
position = [0.35, 0, 0]
normal = [-1, 0, 0]
fixed = true
material = "wall"
[[body]]
name = "free"
mass = 2
inertia = [0.1, 0.1, 0.1]
[[body]]
name = "held"
shape = "sphere"
radius = 0.1
mass = 2
material = "wall"
[[pair]]
between = ["wall", "wall"]
friction = 0.3
[[joint]]
kind = "slider"
bodies = ["free", "world"]
axis = [1, 0, 0]
motor = { stiffness = 1, damping = 1, target = 0.5 }
[[joint]]
kind = "slider"
bodies = ["held", "world"]
axis = [1, 0, 0]
motor = { stiffness = 1, damping = 1, target = 0.5, force = 30 }
)");
      scene.stepping->step = step;
      for (Joint& joint : scene.joints) {
        joint.motor->stiffness = gain;
        joint.motor->damping = std::sqrt(gain);
      }
      INFO(gain << " " << step);
      const auto engine = make_engine(scene);
      double furthest = 0;
      while (engine->time() < 10) {
        engine->advance(engine->time() + step);
        furthest = std::max(furthest, engine->bodies()[1].position.x());
      }
      CHECK(furthest < 0.8);
      CHECK(std::abs(engine->bodies()[1].position.x() - 0.5) < 1e-3);
      CHECK(engine->bodies()[1].velocity.norm() < 1e-3);
      // The wall holds it 0.25 m from its target.
      CHECK(std::abs(engine->bodies()[2].position.x() - 0.25) < 1e-6);
      REQUIRE(engine->contacts().size() == 1);
      const double force = std::min(gain * 0.25, 30.0);
      CHECK(std::abs(engine->contacts()[0].force.norm() - force) < 1e-3 * force);
    }
}

TEST_CASE("springs and gains of joints are read and written, and refused by name") {
  const Scene scene = scene_of(kWheels), again = scene_of(write_scene(scene));
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint &a = scene.joints[j], &b = again.joints[j];
    REQUIRE(a.spring.has_value() == b.spring.has_value());
    REQUIRE(a.motor.has_value() == b.motor.has_value());
    if (a.spring)
      CHECK((a.spring->stiffness == b.spring->stiffness && a.spring->damping == b.spring->damping &&
             a.spring->rest == b.spring->rest));
    if (a.motor)
      CHECK((a.motor->stiffness == b.motor->stiffness && a.motor->target == b.motor->target &&
             a.motor->bound == b.motor->bound && a.motor->rate == b.motor->rate));
  }
  const std::string hinge = "kind = \"hinge\"\nat = [0, 0, 0]\naxis = [0, 0, 1]\n";
  const std::string ball = "kind = \"ball\"\nat = [0, 0, 0]\n";
  const struct {
    std::string joint;
    const char* words;
  } wrong[] = {{hinge + "spring = {}", "spring: stiffness"},
               {hinge + "spring = { stiffness = -1 }", "spring: stiffness"},
               {hinge + "spring = { stiffness = 1, rest = 2 }", "rest"},
               {ball + "spring = { stiffness = 1, rest_deg = 2 }", "rest_deg"},
               {ball + "motor = { rate_rad = 1, torque = 2 }", "motor"},
               {hinge + "motor = { rate_rad = 1 }", "torque"},
               {hinge + "motor = { rate_rad = 1, damping = 1, target_deg = 3 }", "target_deg"},
               {hinge + "motion = { rate_deg = 1 }\nspring = { stiffness = 1 }", "spring"},
               {"kind = \"fixed\"\nat = [0, 0, 0]\nspring = { stiffness = 1 }", "spring"}};
  for (const auto& each : wrong) {
    INFO(each.joint);
    CHECK(contains(why_not(floating(each.joint)), each.words));
  }
}
