// Joints that attach, detach and break. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <sstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "engines_of_texts.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kGravity = 9.81;
constexpr EngineKind kExactOnes[] = {EngineKind::smooth, EngineKind::event};
constexpr EngineKind kAll[] = {EngineKind::smooth, EngineKind::event, EngineKind::stepping};

double accuracy_of(EngineKind kind) { return kind == EngineKind::stepping ? 1e-3 : 1e-10; }

double energy_of(const Engine& engine) {
  const Diagnostics d = engine.diagnostics();
  return d.kinetic_energy + d.potential_energy;
}

const std::string kFalling = R"(
[scene]
end = 1
gravity = [0, 0, -9.81]
[[body]]
name = "ball"
mass = 2
inertia = [0.1, 0.1, 0.1]
velocity = [0.3, 0.2, 0]
[[joint]]
name = "rail"
kind = "slider"
bodies = ["ball", "world"]
axis = [1, 0, -1]
from = 0.5
)";

const std::string kRod = R"(
[scene]
end = 0.8
gravity = [0, 0, -9.81]
[[body]]
name = "ball"
mass = 2
inertia = [0.1, 0.1, 0.1]
position = [0.7, 0, 0]
[[joint]]
name = "rod"
kind = "distance"
bodies = ["ball", "world"]
at = [[0.7, 0, 0], [0, 0, 0]]
break_force = 39.24
)";

// Released from the horizontal a pendulum has the tension 3 m g sin(angle), 2 m g at sin = 2 / 3.
struct BrokenRod {
  static constexpr double kLength = 0.7, kSine = 2.0 / 3;
  double time = 0;
  Vector3d position, velocity;
  BrokenRod() {
    const double angle = std::asin(kSine), speed = std::sqrt(2 * kGravity * kLength * kSine);
    // t' = (l / (2 g sin))^(1/2); with u^2 the angle it is smooth.
    constexpr int kPieces = 2000;
    const double h = std::sqrt(angle) / kPieces;
    const auto rate = [](double u) { return u == 0 ? 2.0 : 2 * u / std::sqrt(std::sin(u * u)); };
    for (int k = 0; k < kPieces; ++k)
      time += h / 6 * (rate(k * h) + 4 * rate((k + 0.5) * h) + rate((k + 1) * h));
    time *= std::sqrt(kLength / (2 * kGravity));
    position = kLength * Vector3d(std::cos(angle), 0, -std::sin(angle));
    velocity = -speed * Vector3d(std::sin(angle), 0, std::cos(angle));
  }
  Vector3d at(double t) const {
    const double dt = t - time;
    return position + dt * velocity - 0.5 * kGravity * dt * dt * Vector3d::UnitZ();
  }
};

// Two bodies that turn and pass each other; `joint` holds them together from 0.3 s on.
std::string passing(const std::string& joint) {
  return two_bodies("1", "[-0.7, 0.2, 0.4]", "from = 0.3\n" + joint);
}

const std::string kWeld = "kind = \"fixed\"\nat = [0, 0, 0]\n";

// Energy of all bodies if they were one rigid body with their momenta.
double rigid_energy(const Scene& scene, const Engine& engine) {
  double mass = 0;
  Vector3d centre = Vector3d::Zero(), momentum = Vector3d::Zero(), spin = Vector3d::Zero();
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    mass += scene.bodies[b].mass;
    centre += scene.bodies[b].mass * engine.bodies()[b].position;
  }
  centre /= mass;
  Matrix3d inertia = Matrix3d::Zero();
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyState& s = engine.bodies()[b];
    const Matrix3d R = s.orientation.toRotationMatrix();
    const Vector3d r = s.position - centre;
    const double m = scene.bodies[b].mass;
    const Matrix3d own = R * scene.bodies[b].inertia * R.transpose();
    inertia += own + m * (r.squaredNorm() * Matrix3d::Identity() - r * r.transpose());
    momentum += m * s.velocity;
    spin += own * s.angular_velocity + m * r.cross(s.velocity);
  }
  return 0.5 * momentum.squaredNorm() / mass + 0.5 * spin.dot(inertia.inverse() * spin);
}

}  // namespace

TEST_CASE("a slider that attaches in flight keeps the momentum along it, and the rest is booked") {
  const Vector3d axis = Vector3d(1, 0, -1).normalized();
  const Vector3d before(0.3, 0.2, -kGravity * 0.5);
  const double kept = before.dot(axis), lost = before.squaredNorm() - kept * kept;  // m / 2 = 1
  for (const EngineKind kind : kAll) {
    const auto engine = engine_of(scene_of(kFalling), kind, accuracy_of(kind));
    engine->advance(0.5);
    REQUIRE(engine->events().size() == 1);
    const ContactEvent event = engine->events()[0];
    CHECK(event.kind == ContactEvent::Kind::attach);
    CHECK(event.joint == 0);
    CHECK(event.time == Approx(0.5).epsilon(1e-12));
    CHECK(event.lost == Approx(lost).epsilon(1e-8));
    CHECK((engine->bodies()[0].velocity - kept * axis).norm() < 1e-8);
    const Vector3d there = engine->bodies()[0].position;
    engine->advance(1);
    const double fall = kGravity * std::sqrt(0.5), t = 0.5;
    // Steps of dt: dt / 2 times the acceleration.
    const double error = kind == EngineKind::stepping ? 0.5 * 1e-3 * fall * t + 1e-9 : 1e-8;
    CHECK((engine->bodies()[0].position - there - (kept * t + 0.5 * fall * t * t) * axis).norm() <
          error);
    CHECK(engine->forces().joints[0].force.norm() ==
          Approx(2 * kGravity * std::sqrt(0.5)).epsilon(1e-6));
  }
}

TEST_CASE("a rod breaks at its tension, and the ball flies on") {
  const BrokenRod rod;
  for (const EngineKind kind : kExactOnes) {
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const auto engine = engine_of(scene_of(kRod), kind, tolerance);
      engine->advance(0.8);
      REQUIRE(engine->events().size() == 1);
      CHECK(engine->events()[0].kind == ContactEvent::Kind::snap);
      CHECK(std::abs(engine->events()[0].time - rod.time) < 10 * tolerance);
      CHECK((engine->bodies()[0].position - rod.at(0.8)).norm() < 20 * tolerance);
      CHECK(engine->forces().joints[0].force.isZero(0));
      CHECK(std::abs(energy_of(*engine)) < 20 * tolerance * 2 * kGravity);
    }
  }
}

TEST_CASE("steps break a rod at the end of a step, with errors of the order of the step") {
  const BrokenRod rod;
  double before = 0;
  for (const double step : {4e-3, 2e-3, 1e-3, 5e-4}) {
    const auto engine = engine_of(scene_of(kRod), EngineKind::stepping, step);
    engine->advance(0.8);
    REQUIRE(engine->events().size() == 1);
    const double late = engine->events()[0].time - rod.time;
    CHECK(std::abs(late) < 2 * step);
    const double error = (engine->bodies()[0].position - rod.at(0.8)).norm();
    CHECK(error < 15 * step);
    before = error;
  }
  CHECK(before < 7e-3);
}

TEST_CASE("two bodies that weld in flight keep both momenta, and lose what a rigid body has not") {
  for (const EngineKind kind : kAll) {
    const Scene scene = scene_of(passing(kWeld));
    const auto engine = engine_of(scene, kind, accuracy_of(kind));
    const auto free = engine_of(
        [&] {
          Scene without = scene;
          without.joints.clear();
          return without;
        }(),
        kind, accuracy_of(kind));
    free->advance(0.3);
    engine->advance(0.3);
    const Diagnostics before = free->diagnostics(), after = engine->diagnostics();
    CHECK((after.momentum - before.momentum).norm() < 1e-12);
    CHECK((after.angular_momentum - before.angular_momentum).norm() < 1e-9);
    const double lost = before.kinetic_energy - rigid_energy(scene, *free);
    REQUIRE(engine->events().size() == 1);
    CHECK(engine->events()[0].lost == Approx(lost).epsilon(1e-9));
    CHECK(after.kinetic_energy == Approx(before.kinetic_energy - lost).epsilon(1e-9));
    engine->advance(1);
    const double drift = kind == EngineKind::stepping ? 2e-3 : 1e-8;
    CHECK(energy_of(*engine) == Approx(before.kinetic_energy - lost).epsilon(drift));
    CHECK((engine->diagnostics().angular_momentum - after.angular_momentum).norm() < 1e-9);
    CHECK((engine->bodies()[0].angular_velocity - engine->bodies()[1].angular_velocity).norm() <
          1e-9);
  }
}

TEST_CASE("every kind of joint closes as its bodies are, and conserves both momenta") {
  const std::string kinds[] = {
      "kind = \"ball\"\nat = [0.5, 0.1, 0.2]\n",
      "kind = \"hinge\"\nat = [0.5, 0, 0]\naxis = [0, 1, 1]\n",
      "kind = \"slider\"\naxis = [1, 2, 0]\n",
      "kind = \"universal\"\nat = [0.5, 0, 0]\naxis = [[1, 0, 0], [0, 1, 0]]\n",
      "kind = \"planar\"\nat = [0.5, 0, 0]\naxis = [0, 0, 1]\n",
      "kind = \"distance\"\nat = [[0.1, 0, 0], [1, 0.3, 0]]\n",
  };
  for (const std::string& joint : kinds)
    for (const EngineKind kind : kAll) {
      const auto engine = engine_of(scene_of(passing(joint)), kind, accuracy_of(kind));
      engine->advance(0.299);
      const Diagnostics before = engine->diagnostics();
      engine->advance(1);
      const Diagnostics after = engine->diagnostics();
      INFO(joint << static_cast<int>(kind));
      CHECK((after.momentum - before.momentum).norm() < 1e-9);
      CHECK((after.angular_momentum - before.angular_momentum).norm() < 1e-8);
      CHECK(after.drift < 1e-8);
      REQUIRE(engine->events().size() == 1);
      CHECK(engine->events()[0].lost > 0);
      if (kind != EngineKind::stepping)
        CHECK(after.kinetic_energy ==
              Approx(before.kinetic_energy - engine->events()[0].lost).epsilon(1e-8));
    }
}

TEST_CASE("a joint attaches to the world in events far from the origin as near it") {
  for (const char* kind :
       {"\"ball\"", "\"fixed\"", "\"hinge\"\naxis = [0, 1, 1]", "\"slider\"\naxis = [1, 2, 0]"}) {
    Vector3d found[2];
    for (const int far : {0, 1}) {
      const Vector3d place(-30.0 * far, 100.0 * far, 0);
      Scene s = scene_of(fmt::format(R"(
[scene]
end = 0.1
gravity = [0, 0, -9.81]
[[body]]
name = "ball"
shape = "sphere"
radius = 0.2
mass = 1
position = [{0}, {1}, 0]
angular_velocity = [1, 2, 3]
[[joint]]
name = "late"
kind = {2}
bodies = ["ball", "world"]
at = [{3}, {1}, 0]
from = 0.05
)",
                                     place.x(), place.y(), kind, place.x() + 0.4));
      const auto engine = engine_of(s, EngineKind::event, 1e-10);
      engine->advance(0.1);
      found[far] = engine->bodies()[0].position - place;
    }
    INFO(kind);
    CHECK((found[1] - found[0]).norm() < 1e-8);
  }
}

TEST_CASE("a hinge that attaches counts its angle from there, and detaches at its time") {
  const std::string text = passing(
      "kind = \"hinge\"\nat = [0.5, 0, 0]\naxis = [0, 1, 1]\nto = 0.6\n"
      "spring = { stiffness = 5 }\n");
  for (const EngineKind kind : kExactOnes) {
    const auto engine = engine_of(scene_of(text), kind, 1e-10);
    engine->advance(0.3);
    CHECK(std::abs(engine->forces().joints[0].drive) < 1e-9);
    const double energy = energy_of(*engine);
    engine->advance(0.6 - 1e-9);
    CHECK(energy_of(*engine) == Approx(energy).epsilon(1e-8));
    CHECK(std::abs(engine->forces().joints[0].drive) > 0.01);
    const BodyState before = engine->bodies()[1];
    engine->advance(1);
    REQUIRE(engine->events().size() == 2);
    CHECK(engine->events()[1].kind == ContactEvent::Kind::detach);
    CHECK(engine->events()[1].time == Approx(0.6).epsilon(1e-12));
    CHECK((engine->bodies()[1].position - before.position - 0.4 * before.velocity).norm() < 1e-7);
    CHECK(engine->forces().joints[0].force.isZero(0));
  }
}

TEST_CASE(
    "of two rods the weaker one breaks first, and the other at once if it cannot hold alone") {
  const auto rods = [](double first, double second) {
    return scene_of(fmt::format(R"(
[scene]
end = 0.1
gravity = [0, 0, -10]
[[body]]
name = "lamp"
mass = 1
inertia = [0.1, 0.1, 0.1]
[[joint]]
name = "left"
kind = "distance"
bodies = ["lamp", "world"]
at = [[0, 0, 0], [-1, 0, 1]]
break_force = {}
[[joint]]
name = "right"
kind = "distance"
bodies = ["lamp", "world"]
at = [[0, 0, 0], [1, 0, 1]]
break_force = {}
)",
                                first, second));
  };
  for (const EngineKind kind : kExactOnes) {
    // Each has 10 / 2^(1/2); the one that is left has as much, and swings.
    const auto none = engine_of(rods(7.2, 7.2), kind, 1e-8);
    none->advance(0.1);
    CHECK(none->events().empty());
    const auto one = engine_of(rods(6, 7.2), kind, 1e-8);
    one->advance(1e-3);
    REQUIRE(one->events().size() == 1);
    CHECK(one->events()[0].joint == 0);
    CHECK(one->events()[0].time == 0);
    const auto both = engine_of(rods(6, 7), kind, 1e-8);
    both->advance(1e-3);
    REQUIRE(both->events().size() == 2);
    CHECK(both->events()[1].joint == 1);
    both->advance(0.1);
    CHECK(both->bodies()[0].position.z() == Approx(-0.05).epsilon(1e-7));
  }
}

TEST_CASE(
    "a sliding block that couples with one at rest goes on with half its speed until friction "
    "stops both") {
  const std::string text = R"(
[scene]
end = 1
gravity = [0, 0, -10]
[[body]]
name = "floor"
fixed = true
shape = "plane"
material = "floor"
[[body]]
name = "a"
shape = "box"
size = [0.4, 0.4, 0.2]
mass = 2
position = [0, 0, 0.1]
velocity = [3, 0, 0]
material = "wagon"
[[body]]
name = "b"
shape = "box"
size = [0.4, 0.4, 0.2]
mass = 2
position = [1, 0, 0.1]
material = "wagon"
[[pair]]
between = ["floor", "wagon"]
friction = 0.3
[[pair]]
between = ["wagon", "wagon"]
touch = false
[[joint]]
name = "coupling"
kind = "fixed"
bodies = ["a", "b"]
at = [0.5, 0, 0.1]
from = 0.2
)";
  const double speed = 3 - 3 * 0.2, after = speed / 2;
  const double way = 3 * 0.2 - 1.5 * 0.04 + after * after / 6,
               lost = speed * speed - 2 * after * after;
  for (const EngineKind kind : {EngineKind::event, EngineKind::stepping}) {
    const double accuracy = kind == EngineKind::event ? 1e-8 : 1e-3;
    const auto engine = engine_of(scene_of(text), kind, accuracy);
    engine->advance(1);
    CHECK(std::abs(engine->bodies()[1].position.x() - way) <
          (kind == EngineKind::event ? 1e-7 : 4e-3));
    CHECK(std::abs(engine->bodies()[2].position.x() - 1 - after * after / 6) <
          (kind == EngineKind::event ? 1e-7 : 4e-3));
    CHECK(engine->bodies()[1].velocity.norm() < 1e-6);
    double booked = 0;
    for (const ContactEvent& each : engine->events())
      if (each.kind == ContactEvent::Kind::attach) booked += each.lost;
    CHECK(booked == Approx(lost).epsilon(kind == EngineKind::event ? 1e-7 : 1e-5));
  }
}

TEST_CASE("a joint breaks at a peak of its reaction between the ends of a step") {
  // A load of 0.5 Hz, of which the engines take eight steps a period, exceeds the bound by 1e-5.
  const std::string text = R"(
[scene]
end = 3
[[body]]
name = "block"
mass = 1
inertia = [0.1, 0.1, 0.1]
[[joint]]
kind = "fixed"
bodies = ["block", "world"]
at = [0, 0, 0]
break_force = 9.9999
[[load]]
body = "block"
force = [10, 0, 0]
sine = { frequency = 0.5, phase_deg = 0 }
)";
  const double time = std::asin(0.99999) / M_PI;
  for (const EngineKind kind : kExactOnes) {
    const auto engine = engine_of(scene_of(text), kind, 1e-8);
    engine->advance(3);
    REQUIRE(engine->events().size() == 1);
    CHECK(std::abs(engine->events()[0].time - time) < 1e-9);
    // v' = 10 sin(pi t) from then on.
    CHECK(engine->bodies()[0].velocity.x() ==
          Approx(10 / M_PI * (std::cos(M_PI * time) - std::cos(3 * M_PI))).epsilon(1e-6));
  }
}

TEST_CASE(
    "joints that cannot close together, and bodies that overlap when let go, end the run by name") {
  const std::string driven = R"(
[scene]
end = 1
[[body]]
name = "carriage"
mass = 1
inertia = [0.2, 0.3, 0.4]
velocity = [1, 0, 0]
[[joint]]
name = "rail"
kind = "slider"
bodies = ["carriage", "world"]
axis = [1, 0, 0]
motion = { rate = 1 }
[[joint]]
name = "clamp"
kind = "fixed"
bodies = ["carriage", "world"]
at = [0, 0, 0]
from = 0.5
)";
  for (const EngineKind kind : kAll) {
    const auto engine = engine_of(scene_of(driven), kind, accuracy_of(kind));
    const std::string why = tether::test::thrown<SimulationError>([&] { engine->advance(1); });
    CHECK(contains(why, "t = 0.5 s"));
    CHECK(contains(why, "cannot close"));
  }
  const std::string nested = R"(
[scene]
end = 1
[[body]]
name = "a"
shape = "sphere"
radius = 1
mass = 1
material = "m"
[[body]]
name = "b"
shape = "sphere"
radius = 1
mass = 1
position = [1.5, 0, 0]
material = "m"
[[pair]]
between = ["m", "m"]
[[joint]]
kind = "fixed"
bodies = ["a", "b"]
at = [0, 0, 0]
to = 0.5
)";
  const auto engine = engine_of(scene_of(nested), EngineKind::event, 1e-6);
  const std::string why = tether::test::thrown<SimulationError>([&] { engine->advance(1); });
  CHECK(contains(why, "detach"));
  CHECK(contains(why, "overlap"));
}

TEST_CASE(
    "a body at rest that is coupled to a driven one gets its speed, and the energy it takes") {
  const std::string text = R"(
[scene]
end = 1
[[body]]
name = "engine"
mass = 5
inertia = [1, 1, 1]
velocity = [2, 0, 0]
[[body]]
name = "wagon"
mass = 3
inertia = [1, 1, 1]
position = [4, 0, 0]
[[joint]]
name = "rail"
kind = "slider"
bodies = ["engine", "world"]
axis = [1, 0, 0]
motion = { rate = 2 }
[[joint]]
name = "hook"
kind = "ball"
bodies = ["engine", "wagon"]
at = [4, 0, 0]
from = 0.5
)";
  for (const EngineKind kind : kAll) {
    const auto engine = engine_of(scene_of(text), kind, accuracy_of(kind));
    engine->advance(0.5);
    REQUIRE(engine->events().size() == 1);
    CHECK(engine->events()[0].lost == Approx(-0.5 * 3 * 4).epsilon(1e-9));
    CHECK(engine->bodies()[1].velocity.x() == Approx(2).epsilon(1e-9));
    engine->advance(1);
    CHECK(engine->bodies()[1].position.x() == Approx(5).epsilon(1e-8));
  }
}

TEST_CASE("a run with joints that attach and break goes on from a saved state with its bits") {
  const std::string text = passing(kWeld + "to = 0.7\n");
  for (const EngineKind kind : kAll)
    for (const double saved : {0.2, 0.5, 0.8}) {
      const auto a = engine_of(scene_of(text), kind, kind == EngineKind::stepping ? 1e-3 : 1e-8);
      const auto b = engine_of(scene_of(text), kind, kind == EngineKind::stepping ? 1e-3 : 1e-8);
      a->advance(saved);
      std::stringstream state;
      a->save(state);
      b->restore(state);
      a->advance(1);
      b->advance(1);
      for (std::size_t k = 0; k < 2; ++k) {
        CHECK(a->bodies()[k].position == b->bodies()[k].position);
        CHECK(a->bodies()[k].angular_velocity == b->bodies()[k].angular_velocity);
      }
    }
}

TEST_CASE("what windows of joints do not have is refused by name") {
  const std::string rod = kRod.substr(0, kRod.find("break_force"));
  CHECK(contains(why_not(rod + "from = 0.5\nlength = 1\n"), "length"));
  CHECK(contains(why_not(rod + "from = 0.5\nmotion = { rate = 1 }\n"), "motion"));
  CHECK(contains(why_not(rod + "break_moment = 1\n"), "has no"));
  CHECK(contains(why_not(rod + "from = 0.5\nto = 0.5\n"), "must be after from"));
  CHECK(contains(why_not(rod + "from = -1\n"), "from"));
  CHECK(contains(why_not(rod + "break_force = 0\n"), "break_force"));
  CHECK(contains(why_not(rod + "break_forces = 1\n"), "break_forces"));
  CHECK(contains(why_not(rod + "to = 1\n[event]\notherwise = \"stepping\"\n"), "otherwise"));
  Scene late = scene_of(kRod);
  late.event.emplace().otherwise = Otherwise::stepping;  // as --otherwise does
  CHECK(contains(tether::test::thrown<std::invalid_argument>([&] { make_engine(late); }),
                 "otherwise"));
  Scene scene = scene_of(kRod);
  CHECK(contains(tether::test::thrown<std::invalid_argument>([&] { make_smooth_engine(scene); }),
                 "make_engine"));
  std::ostringstream plan;
  plan << make_plan(scene_of(kFalling + "break_force = 100\n"));
  CHECK(contains(plan.str(), "attach, detach    1 joint"));
  CHECK(contains(plan.str(), "breaking          1 joint"));
}
