// Limits, motors and friction of joints. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <sstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "jointed_scenes.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace mechanisms;
using namespace tether::scene;

namespace {

const Vector3d kDown(0, 0, -kGravity);
constexpr double kPi = 3.14159265358979323846;

Scene steps_of(double step) {
  Scene s;
  s.stepping.emplace().step = step;
  return s;
}

// A mass on a slider along the axis.
Scene sliding(double step, double mass, const Vector3d& axis) {
  Scene s = steps_of(step);
  s.bodies.push_back(ball("carriage", {0, 0, 0}, mass, 0.01 * mass));
  s.joints.push_back(joint(JointKind::slider, 0, kWorld, {0, 0, 0}));
  s.joints[0].axis = axis;
  return s;
}

// A flywheel on the axis z.
Scene turning(double step, double inertia, double speed) {
  Scene s = steps_of(step);
  s.bodies.push_back(ball("wheel", {0, 0, 0}, 1, inertia));
  s.bodies[0].angular_velocity = {0, 0, speed};
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0}));
  return s;
}

// Times at which the angular velocity of body 0 about y jumps in sign at the limit.
std::vector<double> bounces(const Scene& s, double end) {
  const auto engine = make_engine(s);
  std::vector<double> times;
  double last = 0;
  while (engine->time() < end) {
    engine->advance(engine->time() + s.stepping->step);
    const double now = engine->bodies()[0].angular_velocity.y();
    const bool low = engine->bodies()[0].position.z() < -0.95;
    if (last * now < 0 && low) times.push_back(engine->time());
    last = now;
  }
  return times;
}

std::string refusal(const Scene& s) {
  return tether::test::thrown([&] { make_engine(s); });
}

}  // namespace

TEST_CASE("a pendulum strikes its limit at the lowest point: oracle 14, order 1") {
  const double exact[] = {.538218666720128926, 1.58544198624292315, 2.61574618289199347,
                          3.63584806565328866};
  double last = 0;
  for (const double step : {1e-2, 1e-3, 1e-4}) {
    Scene s = steps_of(step);
    s.gravity = kDown;
    const double angle = kPi / 3;
    s.bodies.push_back(ball("bob", {std::sin(angle), 0, -std::cos(angle)}, 1, 1e-6));
    s.joints.push_back(hinge(0, kWorld, {0, 0, 0}, {0, 1, 0}));
    s.joints[0].limits = {-0.1, angle, 0.8};
    const std::vector<double> found = bounces(s, 3.8);
    REQUIRE(found.size() == 4);
    double error = 0;
    for (int k = 0; k < 4; ++k) error = std::max(error, std::abs(found[k] - exact[k]));
    INFO(step << ": " << error);
    CHECK(error < 10 * step);
    if (last > 0) CHECK(error < 0.3 * last);
    last = error;
  }
}

TEST_CASE("a pendulum on a limit without restitution stops there, and the limit carries it") {
  Scene s = steps_of(1e-3);
  s.gravity = kDown;
  s.bodies.push_back(ball("bob", {1, 0, 0}, 2, 1e-3));
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0}, {0, 1, 0}));
  s.joints[0].limits = {-0.1, 0.5, 0};  // downwards
  const auto engine = make_engine(s);
  engine->advance(2);
  const BodyState& b = engine->bodies()[0];
  CHECK(std::abs(b.position.x() - std::cos(0.5)) < 1e-9);
  CHECK(std::abs(b.position.z() + std::sin(0.5)) < 1e-9);
  CHECK(b.velocity.norm() < 1e-9);
  const JointForce f = engine->forces().joints[0];
  CHECK((f.force - Vector3d(0, 0, 2 * kGravity)).norm() < 1e-6);
  CHECK(std::abs(f.drive + 2 * kGravity * std::cos(0.5)) < 1e-6);
}

TEST_CASE("a limit gives back a part of the speed with which the step began, not of its forces'") {
  for (const double scale : {1e-6, 1.0, 1e6}) {  // of lengths, with times by its root
    const double time = std::sqrt(scale);
    Scene s = sliding(2e-2 * time, 2, {0, 0, 1});
    s.gravity = kDown;
    s.joints[0].limits = {-0.3 * scale, scale, 0.7};
    const auto engine = make_engine(s);
    int strikes = 0;
    double before = 0;
    for (int step = 0; step < 60; ++step) {
      engine->advance(engine->time() + s.stepping->step);
      const double now = engine->bodies()[0].velocity.z();
      if (before < 0 && now > 0) {
        ++strikes;
        // It would climb against its weight in the rest of the step: with no more energy than
        // before.
        const double weight = kGravity * s.stepping->step;
        const double most = std::sqrt(weight * weight + before * before) - weight;
        CHECK(now == Approx(std::min(-0.7 * before, most)).epsilon(1e-12));
      }
      before = now;
    }
    CHECK(strikes >= 2);
  }
}

TEST_CASE("a bead that a turning rod throws against its limit stays there: no drift adds up") {
  const double speed = 10, step = 1e-3;
  Scene s = steps_of(step);
  s.bodies.push_back(ball("rod", {0, 0, 0}, 1, 1e6));
  s.bodies[0].angular_velocity = {0, 0, speed};
  s.bodies.push_back(ball("bead", {0.5, 0, 0}, 1, 1e-3));
  s.bodies[1].angular_velocity = {0, 0, speed};
  s.bodies[1].velocity = {0, 0.5 * speed, 0};
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0}));
  s.joints.push_back(joint(JointKind::slider, 1, 0, {0.5, 0, 0}));
  s.joints[1].axis = {1, 0, 0};
  s.joints[1].limits = {-0.1, 0.2, 0};
  const auto engine = make_engine(s);
  engine->advance(5);
  // A step along its tangent leads r (w h)^2 / 2 beyond the circle; a fifth of what is left is
  // taken back in each.
  const double beyond = engine->bodies()[1].position.norm() - 0.7;
  CHECK(beyond > -1e-9);
  CHECK(beyond < 5 * 0.7 * std::pow(speed * step, 2) / 2 * 1.1);
}

TEST_CASE("a motor below its limit of force drives the speed, above it gives that force") {
  for (const double scale : {1e-6, 1.0, 1e6}) {  // of lengths, with times by its root
    const double time = std::sqrt(scale), m = 2, g = kGravity;
    for (const double bound : {15.0, 25.0, 1e12}) {
      Scene s = sliding(1e-3 * time, m, {0, 0, 1});
      s.gravity = kDown;
      s.joints[0].motor = {0.5 * scale / time, bound};
      const auto engine = make_engine(s);
      engine->advance(0.4 * time);
      const double a = bound / m - g, rise = std::max(0.5 / a, 0.0);
      const bool fails = a < 0;
      const double speed = fails ? a * 0.4 : 0.5;
      const double way = fails ? 0.08 * a : 0.5 * 0.4 - 0.25 * rise;
      INFO(scale << " " << bound);
      CHECK(std::abs(engine->bodies()[0].velocity.z() * time / scale - speed) < 1e-9);
      CHECK(std::abs(engine->bodies()[0].position.z() / scale - way) < 2e-3);
      CHECK(std::abs(engine->forces().joints[0].drive - (fails ? bound : m * g)) < 1e-6);
    }
  }
}

TEST_CASE("a motor turns a wheel against a load: its moment is the load's, or its limit") {
  for (const double bound : {2.0, 5.0}) {
    Scene s = turning(1e-3, 0.4, 0);
    s.loads.emplace_back().torque = {0, 0, -3};
    s.joints[0].motor = {4, bound};
    const auto engine = make_engine(s);
    engine->advance(2);
    const double speed = bound > 3 ? 4 : (bound - 3) / 0.4 * 2;
    CHECK(std::abs(engine->bodies()[0].angular_velocity.z() - speed) < 1e-9);
    CHECK(std::abs(engine->forces().joints[0].drive - std::min(bound, 3.0)) < 1e-7);
  }
}

TEST_CASE("a sliding brake stops after m v / F and m v^2 / 2 F, and holds") {
  for (const double step : {1e-2, 1e-3}) {
    Scene s = sliding(step, 2, {1, 2, 2});
    s.bodies[0].velocity = 3 * Vector3d(1, 2, 2) / 3;
    s.joints[0].friction = 4;
    const auto engine = make_engine(s);
    engine->advance(1.5 - 2 * step);
    CHECK(engine->bodies()[0].velocity.norm() > 0);
    CHECK(std::abs(engine->forces().joints[0].drive + 4) < 1e-9);
    engine->advance(1.5 + 2 * step);
    CHECK(engine->bodies()[0].velocity.norm() < 1e-12);
    engine->advance(3);
    CHECK(std::abs(engine->bodies()[0].position.norm() - 2.25) < 2 * step);
    CHECK(std::abs(engine->forces().joints[0].drive) < 1e-9);
  }
}

TEST_CASE("a brake on a wheel stops it after I w / M; below its bound it carries the load") {
  Scene s = turning(1e-3, 0.4, 10);
  s.joints[0].friction = 2;
  auto engine = make_engine(s);
  engine->advance(1.999);
  CHECK(engine->bodies()[0].angular_velocity.z() > 0);
  engine->advance(2.001);
  CHECK(std::abs(engine->bodies()[0].angular_velocity.z()) < 1e-10);
  s.loads.emplace_back().torque = {0, 0, 1.9};
  s.bodies[0].angular_velocity.setZero();
  engine = make_engine(s);
  engine->advance(1);
  CHECK(engine->bodies()[0].angular_velocity.norm() < 1e-12);
  CHECK(std::abs(engine->forces().joints[0].drive + 1.9) < 1e-9);
  s.loads[0].torque = {0, 0, 2.4};
  engine = make_engine(s);
  engine->advance(1);
  CHECK(std::abs(engine->bodies()[0].angular_velocity.z() - 1) < 1e-9);
}

TEST_CASE("motor and friction on one joint, and a limit beyond half a turn") {
  Scene s = turning(1e-3, 0.4, 0);
  s.joints[0].motor = {100, 5};
  s.joints[0].friction = 2;
  s.joints[0].limits = {-0.2, 1.5 * kPi, 0};
  const auto engine = make_engine(s);
  engine->advance(0.5);
  CHECK(std::abs(engine->bodies()[0].angular_velocity.z() - 3 / 0.4 * 0.5) < 1e-8);
  CHECK(std::abs(engine->forces().joints[0].drive - 3) < 1e-7);  // motor less friction
  engine->advance(2);
  const BodyState& b = engine->bodies()[0];
  CHECK((b.orientation * Vector3d::UnitX() - Vector3d(0, -1, 0)).norm() < 1e-8);
  CHECK(b.angular_velocity.norm() < 1e-9);
}

TEST_CASE("two bodies that strike the limit between them keep momenta and, at e = 1, energy") {
  for (const double e : {0.0, 0.5, 1.0}) {
    Scene s = steps_of(1e-4);
    s.bodies.push_back(ball("first", {0.5, 0, 0}, 1, 0.1));
    s.bodies.push_back(ball("second", {-0.5, 0, 0}, 3, 0.2));
    // The hinge at the origin stays there: v = w x r.
    s.bodies[0].angular_velocity = {0, 0, 2};
    s.bodies[0].velocity = {0, 1, 0};
    s.bodies[1].angular_velocity = {0, 0, -1};
    s.bodies[1].velocity = {0, 0.5, 0};
    s.joints.push_back(hinge(0, 1, {0, 0, 0}));
    s.joints[0].limits = {-1, 0.3, e};
    const auto engine = make_engine(s);
    const Diagnostics before = engine->diagnostics();
    engine->advance(0.05);
    const auto relative = [&] {
      return engine->bodies()[0].angular_velocity.z() - engine->bodies()[1].angular_velocity.z();
    };
    const double came = relative();
    CHECK(came > 0);
    engine->advance(0.2);
    const Diagnostics after = engine->diagnostics();
    CHECK(relative() <= 1e-6);
    if (e == 1)
      CHECK(std::abs(after.kinetic_energy - before.kinetic_energy) < 1e-3 * before.kinetic_energy);
    if (e < 1) CHECK(after.kinetic_energy < before.kinetic_energy);
    CHECK((after.momentum - before.momentum).norm() < 1e-11);
    CHECK((after.angular_momentum - before.angular_momentum).norm() < 1e-11);
  }
}

namespace {

// Pressed by its motor, of 7 N m about y.
Scene lever_on_floor(double friction) {
  Scene s = jointed_scenes::stepping(1e-3, kDown);
  const Vector3d tip(std::sqrt(0.75), 0, 0);
  s.bodies.push_back(rod("lever", {0, 0, 0.5}, tip, 2));
  jointed_scenes::touch(s.bodies[0], {tip});
  jointed_scenes::add_wall(s, Vector3d::Zero(), Vector3d::UnitZ(), friction);
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0.5}, {0, 1, 0}));
  s.joints[0].motor = {1, 7};  // downwards
  return s;
}

}  // namespace

// The gap that an inelastic impact leaves is closed by a problem of its own, of the contacts of its
// island alone: what a motor does there is no force of the step.
TEST_CASE("a motor's moment is the same in steps in which something else falls to the floor") {
  Scene s = lever_on_floor(0.5);
  s.joints[0].motor->bound = 7000;
  s.bodies.push_back(ball("falling", {3, 0, 0.1 + 0.0123}, 1, 0.01));
  jointed_scenes::touch_sphere(s.bodies[2], 0.1);
  const auto engine = make_engine(s);
  bool fell = false, rests = false;
  for (int k = 1; k <= 100; ++k) {
    engine->advance(k * 1e-3);
    fell = fell || engine->bodies()[2].velocity.z() < -0.4;
    rests = fell && engine->bodies()[2].velocity.norm() < 1e-9;
    INFO("t = " << engine->time());
    if (k > 20) CHECK(std::abs(engine->forces().joints[0].drive - 7000) < 1e-3);
  }
  CHECK(fell);
  CHECK(rests);
}

TEST_CASE("a motor presses a lever onto the floor: contact and motor in one solve") {
  for (const double friction : {0.0, 0.5}) {
    const Scene s = lever_on_floor(friction);
    const auto engine = make_engine(s);
    engine->advance(0.1);
    CHECK(engine->bodies()[0].velocity.norm() < 1e-7);
    const double arm = std::sqrt(0.75);
    CHECK(std::abs(engine->forces().joints[0].drive - 7) < 1e-6);
    // Moments about the hinge; friction has none of its own that the joint would not carry.
    const Forces f = total_forces(*engine);
    CHECK(std::abs(f.contact[0].z() * arm + f.contact[0].x() * 0.5 - 7 - 2 * kGravity * arm / 2) <
          1e-6);
    if (friction == 0) CHECK(std::abs(f.contact[0].z() - 7 / arm - kGravity) < 1e-6);
  }
}

TEST_CASE("steps in parts within an accuracy meet limits and brakes") {
  Scene s = sliding(0.05, 2, {1, 0, 0});
  s.stepping->accuracy = 1e-4;
  s.bodies[0].velocity = {3, 0, 0};
  s.joints[0].friction = 4;
  s.joints[0].limits = {-1, 1, 0.5};
  const auto engine = make_engine(s);
  engine->advance(1);
  // v = sqrt(9 - 4) at the limit at t = (3 - sqrt 5) / 2, back with half of it.
  const double v = std::sqrt(5.0), t1 = (3 - v) / 2, back = 0.5 * v, t = 0.5 * back;
  CHECK(t1 + t < 1);
  CHECK(std::abs(engine->bodies()[0].position.x() - (1 - back * back / 4)) < 2e-3);
  CHECK(engine->bodies()[0].velocity.norm() < 1e-7);
}

TEST_CASE("steps in parts end where a mass on a spring turns in a guide that rubs") {
  // x'' + x = -F sgn x' from 1 m, turns at k pi. Without cuts there 2.5e-3 and 2.9e-4 m off, for
  // 492 and 3201 problems.
  struct Case {
    double friction, accuracy, error;
    long problems;
  };
  for (const Case& c : {Case{0.15, 1e-3, 1.3e-3, 540}, Case{0.11, 1e-5, 1.4e-4, 3300}}) {
    CAPTURE(c.friction, c.accuracy);
    Scene s = sliding(0.09, 1, {1, 0, 0});
    s.stepping->accuracy = c.accuracy;
    s.bodies[0].inertia = Eigen::Matrix3d::Identity();  // of which its size is told
    s.bodies[0].position = {1, 0, 0};
    s.joints[0].friction = c.friction;
    Spring spring;
    spring.first = 0;
    spring.second = -1;
    spring.at = {1, 0, 0};
    spring.at_second = {-15, 0, 0};
    spring.stiffness = 1;
    spring.rest = 15;
    s.springs.push_back(spring);
    const auto engine = make_engine(s);
    engine->advance(9);
    // Its second turn was at 2 pi.
    const double x = c.friction + (1 - 5 * c.friction) * std::cos(9 - 2 * M_PI);
    CHECK(std::abs(engine->bodies()[0].position.x() - x) < c.error);
    CHECK(engine->counts().contact_problems < c.problems);
  }
}

TEST_CASE("a run of joint laws goes on from a saved state with the same bits") {
  Scene s = turning(1e-3, 0.4, 3);
  s.gravity = Vector3d(0, -9.81, 0);
  s.bodies[0].position = {0.3, 0, 0};
  s.bodies[0].velocity = {0, 0.9, 0};
  s.joints[0].limits = {-2, 0.4, 0.6};
  s.joints[0].friction = 0.3;
  s.joints[0].motor = {2, 1};
  const auto whole = make_engine(s), part = make_engine(s), next = make_engine(s);
  whole->advance(1.5);
  part->advance(0.7);
  std::stringstream saved;
  part->save(saved);
  next->restore(saved);
  next->advance(1.5);
  CHECK(next->bodies()[0].position == whole->bodies()[0].position);
  CHECK(next->bodies()[0].angular_velocity == whole->bodies()[0].angular_velocity);
}

TEST_CASE("joint laws are read, written, planned, and refused by name where they cannot be") {
  const std::string text = R"(
[scene]
[[body]]
name = "a"
shape = "sphere"
radius = 0.1
mass = 1
[[joint]]
name = "h"
kind = "hinge"
bodies = ["a", "world"]
at = [1, 0, 0]
axis = [0, 1, 0]
limits_deg = [-90, 45]
limit_restitution = 0.5
motor = { rate_deg = 180, torque = 3 }
friction = 0.25
)";
  const Scene s = parse_scene(text, "laws.toml");
  const Joint& h = s.joints[0];
  CHECK(std::abs(h.limits->lower + kPi / 2) < 1e-15);
  CHECK(std::abs(h.motor->rate - kPi) < 1e-15);
  CHECK((h.limits->restitution == 0.5 && h.motor->bound == 3 && h.friction == 0.25));
  CHECK(write_scene(parse_scene(write_scene(s), "again.toml")) == write_scene(s));
  const Plan plan = make_plan(s);
  CHECK(plan.engine == EngineKind::stepping);
  std::ostringstream told;
  told << plan;
  for (const char* word : {"joint limits", "motors", "joint friction", "joints have limits"})
    CHECK(told.str().find(word) != std::string::npos);
  CHECK(std::string(make_engine(s)->name()) == "stepping");

  Scene wrong = s;
  wrong.smooth.emplace();
  CHECK(refusal(wrong).find("smooth engine does not have") != std::string::npos);
  wrong = s;
  wrong.engine = EngineKind::event;
  CHECK(std::string(make_engine(wrong)->name()) == "event");
  wrong = s;
  wrong.stepping.emplace().law = tether::contact::Law::frictionless;
  CHECK(refusal(wrong).find("need law = coulomb") != std::string::npos);
  wrong = s;
  wrong.joints[0].motion.emplace().rate = 1;
  CHECK(refusal(wrong).find("joint \"h\"") != std::string::npos);
  wrong = s;
  wrong.joints[0].kind = JointKind::ball;
  CHECK(refusal(wrong).find("hinges and sliders") != std::string::npos);
  wrong = s;
  wrong.joints[0].limits->lower = 0.1;
  CHECK(refusal(wrong).find("between its limits") != std::string::npos);

  const auto reads = [&](const std::string& from, const std::string& to, const std::string& says) {
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    const std::string said =
        tether::test::thrown<SceneError>([&] { parse_scene(changed, "laws.toml"); });
    INFO(to << ": " << said);
    CHECK(said.find(says) != std::string::npos);
  };
  reads("[-90, 45]", "[10, 45]", "between them");
  reads("[-90, 45]", "[-200, 170]", "full turn");
  reads("torque = 3", "force = 3", "torque");
  reads("friction = 0.25", "friction = -1", "friction");
  reads("kind = \"hinge\"", "kind = \"ball\"", "limits_deg");
}

namespace {

// A ball that bounces on the ground for ever, of restitution 1.
constexpr const char* kElasticBall = R"(
[scene]
end = 3
gravity = [0, 0, -9.81]
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "m"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.03
mass = 0.1
position = [0, 0, 0.23]
material = "m"
[[pair]]
between = ["m", "m"]
restitution = 1
)";

// Largest energy above the first one, and loss of the ball's, over its energy, in steps.
struct Energies {
  double gain = 0, lost = 0;
};
Energies energies(const std::string& text, int ball) {
  const Scene scene = parse_scene(text, "test");
  const auto engine = make_engine(scene);
  const auto total = [&] {
    const Diagnostics d = engine->diagnostics();
    return d.kinetic_energy + d.potential_energy;
  };
  const auto of_ball = [&] {
    const BodyState& b = engine->bodies()[static_cast<std::size_t>(ball)];
    return 0.5 * b.velocity.squaredNorm() + kGravity * b.position.z();
  };
  const double first = total(), of_ball_first = of_ball();
  const double kinetic = 0.1 * kGravity * 0.2;
  Energies out;
  while (engine->time() < scene.end) {
    engine->advance(engine->time() + 1e-3);
    out.gain = std::max(out.gain, (total() - first) / kinetic);
    out.lost = std::max(out.lost, std::abs(of_ball() - of_ball_first) / of_ball_first);
  }
  return out;
}

const std::string kGate = R"(
[[body]]
name = "gate"
mass = 1
inertia = [0.1, 0.1, 0.1]
position = [5, 0, -1]
[[joint]]
kind = "hinge"
bodies = ["gate", "world"]
at = [5, 0, 0]
axis = [0, 1, 0]
)";

}  // namespace

TEST_CASE("joint laws: an elastic ball beside a joint with laws keeps its energy") {
  for (const char* law :
       {"limits_deg = [-90, 90]", "friction = 0.1", "motor = { rate_rad = 3, torque = 0.5 }"}) {
    INFO(law);
    CHECK(energies(kElasticBall + kGate + law, 1).lost < 1e-9);
  }
}

TEST_CASE("joint laws: an elastic ball on a plate that a limit and friction hold gains no energy") {
  const std::string plate = R"(
[[body]]
name = "plate"
shape = "box"
size = [1, 1, 0.02]
mass = 5
position = [0, 0, 0.1]
material = "m"
[[joint]]
kind = "hinge"
bodies = ["plate", "world"]
at = [0, 0, 0.1]
axis = [0, 1, 0]
friction = 0.001
limits_deg = [-30, 30]
)";
  std::string text = kElasticBall;
  text.replace(text.find("[0, 0, 0.23]"), 12, "[0.1, 0, 0.43]");
  CHECK(energies(text + plate, 1).gain < 1e-12);
}

TEST_CASE("joint laws: limits that bounce give no energy") {
  const std::string gate = R"(
[scene]
end = 5
gravity = [0, 0, -9.81]
[[body]]
name = "gate"
mass = 1
inertia = [0.1, 0.1, 0.1]
position = [5, 0, 1]
angular_velocity = [0, 0.1, 0]
velocity = [0.1, 0, 0]
[[joint]]
kind = "hinge"
bodies = ["gate", "world"]
at = [5, 0, 0]
axis = [0, 1, 0]
limits_deg = [-40, 40]
limit_restitution = 1
)";
  // The energy of single steps between bounces is of the order of the step.
  CHECK(energies(gate, 0).gain < 0.05);
}

namespace {

// Velocities along z of the bodies at the end, by this engine and this choice.
std::vector<double> velocities(const std::string& scene, const std::string& engine,
                               const std::string& impacts, int axis) {
  const Scene s = parse_scene("[scene]\nend = 0.1\nengine = \"" + engine +
                                  "\"\nsimultaneous_impacts = \"" + impacts + "\"\n" + scene,
                              "test");
  const auto moved = make_engine(s);
  moved->advance(s.end);
  std::vector<double> out;
  for (const BodyState& b : moved->bodies()) out.push_back(b.velocity[axis]);
  return out;
}

}  // namespace

TEST_CASE("simultaneous impacts: steps and events mean the same, together and in turn") {
  // A ball falls on a plate that rests on the limit of its hinge.
  const std::string plate = R"(
[[body]]
name = "plate"
shape = "box"
size = [0.6, 0.2, 0.02]
mass = 2
position = [0.3, 0, 0]
material = "m"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.03
mass = 0.1
position = [0.3, 0, 0.19]
velocity = [0, 0, -3]
material = "m"
[[joint]]
kind = "hinge"
bodies = ["plate", "world"]
at = [0, 0, 0]
axis = [0, -1, 0]
limits_deg = [0, 60]
[[pair]]
between = ["m", "m"]
restitution = 1
friction = 0.3
)";
  // Five balls in a line that touch, the first of which strikes.
  std::string cradle = "[[pair]]\nbetween = [\"m\", \"m\"]\nrestitution = 1\n";
  for (int k = 0; k < 5; ++k)
    cradle +=
        "[[body]]\nshape = \"sphere\"\nradius = 0.05\nmass = 1\nmaterial = \"m\"\nposition = [" +
        std::to_string(k == 0 ? -0.0137 : 0.1 * k) + ", 0, 0]\nvelocity = [" +
        (k == 0 ? "1" : "0") + ", 0, 0]\n";
  for (const char* engine : {"stepping", "event"}) {
    INFO(engine);
    CHECK(velocities(plate, engine, "together", 2)[1] == Approx(3).epsilon(1e-9));
    CHECK(velocities(plate, engine, "in_turn", 2)[1] == Approx(2.78319).epsilon(1e-5));
    const std::vector<double> together = velocities(cradle, engine, "together", 0);
    const std::vector<double> in_turn = velocities(cradle, engine, "in_turn", 0);
    for (std::size_t k = 0; k < 5; ++k) {
      CHECK(together[k] == Approx(k == 0 ? -0.6 : 0.4).epsilon(1e-8));
      CHECK(in_turn[k] == Approx(k < 4 ? 0 : 1).margin(1e-9));
    }
  }
}
