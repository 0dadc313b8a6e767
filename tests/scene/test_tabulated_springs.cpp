// Springs and dampers of joints by tables. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::scene;

namespace tabulated {

Scene tabled(const std::string& text) { return parse_scene(text, "test"); }

// A carriage of 2 kg that is caught by a spring of 8, then 50 N/m, and a flywheel of 0.4 kg m^2
// that a damper slows: 1.5 N m from 3 rad/s on.
const std::string kCaught = R"(
[scene]
end = 2
[[body]]
name = "carriage"
mass = 2
inertia = [0.1, 0.1, 0.1]
velocity = [1.2, 0, 0]
[[body]]
name = "flywheel"
mass = 2
inertia = [0.5, 0.5, 0.4]
angular_velocity = [0, 0, 5]
[[joint]]
name = "rail"
kind = "slider"
bodies = ["carriage", "world"]
axis = [1, 0, 0]
spring = { stiffness_table = [[0.3, 2.4], [2.3, 102.4]] }
[[joint]]
name = "shaft"
kind = "hinge"
bodies = ["flywheel", "world"]
at = [0, 0, 0]
axis = [0, 0, 1]
spring = { damping_table = [[3, 1.5], [4, 1.5]] }
)";

// From the left end of the first piece, w = 2 1/s, into the second, w = 5 1/s.
double caught_at(double t) {
  const double into = std::asin(0.3 * 2 / 1.2) / 2;
  if (t < into) return 1.2 / 2 * std::sin(2 * t);
  // 2 x'' = -2.4 - 50 (x - 0.3): about x = 0.3 - 0.048.
  const double v = 1.2 * std::cos(2 * into), u = t - into;
  return 0.252 + 0.048 * std::cos(5 * u) + v / 5 * std::sin(5 * u);
}

double spins_at(double t) {
  const double until = (5 - 3) * 0.4 / 1.5;
  return t < until ? 5 - 1.5 / 0.4 * t : 3 * std::exp(-0.5 / 0.4 * (t - until));
}

double table_error(const Engine& engine) {
  return std::max(std::abs(engine.bodies()[0].position.x() - caught_at(engine.time())),
                  std::abs(engine.bodies()[1].angular_velocity.z() - spins_at(engine.time())));
}

std::unique_ptr<Engine> table_engine(Scene scene, EngineKind engine, double accuracy) {
  scene.engine = engine;
  if (engine == EngineKind::smooth)
    scene.smooth.emplace().tolerance = accuracy;
  else if (engine == EngineKind::event)
    scene.event.emplace().tolerance = accuracy;
  else
    scene.stepping.emplace().step = accuracy;
  return make_engine(scene);
}

std::string table_refusal(const std::string& spring, const std::string& joint) {
  return tether::test::thrown<SceneError>([&] {
    tabled(
        "[[body]]\nname = \"a\"\nmass = 1\ninertia = [1, 1, 1]\n[[joint]]\nbodies = [\"a\", "
        "\"world\"]\n" +
        joint + "spring = { " + spring + " }\n");
  });
}

// A ball of .5 kg m^2 at a ball joint, turned about an axis of no coordinates with 1.5 rad/s
// against a table: 10 N m/rad up to 0.2 rad, then 2 N m.
constexpr double kTurning = 1.5;
const Eigen::Vector3d kTurnAxis = Eigen::Vector3d(1, 2, -2) / 3;
const std::string kTabledBall = R"(
[scene]
end = 2
[[body]]
name = "ball"
mass = 2
inertia = [0.5, 0.5, 0.5]
angular_velocity = [0.5, 1, -1]
[[joint]]
name = "socket"
kind = "ball"
bodies = ["ball", "world"]
at = [0, 0, 0]
spring = { stiffness_table = [[0.2, 2], [1, 2]] }
)";

/// The angle, and its rate.
std::pair<double, double> turned_at(double t) {
  const double w = std::sqrt(10 / 0.5), into = std::asin(0.2 * w / kTurning) / w;
  if (t < into) return {kTurning / w * std::sin(w * t), kTurning * std::cos(w * t)};
  const double rate = kTurning * std::cos(w * into), since = t - into, slows = 2 / 0.5;
  return {0.2 + rate * since - 0.5 * slows * since * since, rate - slows * since};
}

double ball_error(const Engine& engine) {
  const auto [angle, rate] = turned_at(engine.time());
  const Eigen::AngleAxisd now(engine.bodies()[0].orientation);
  return std::max((now.angle() * now.axis() - angle * kTurnAxis).norm(),
                  (engine.bodies()[0].angular_velocity - rate * kTurnAxis).norm());
}

}  // namespace tabulated

using namespace tabulated;

TEST_CASE("tables of stiffness and damping keep their closed forms by tolerance") {
  for (const EngineKind engine : {EngineKind::smooth, EngineKind::event})
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const auto run = table_engine(tabled(kCaught), engine, tolerance);
      const double before = run->diagnostics().potential_energy;
      CHECK(before == 0);
      for (const double t : {0.2, 0.5, 0.75}) {
        run->advance(t);
        INFO(static_cast<int>(engine)
             << " " << tolerance << " " << t << ", error " << table_error(*run));
        CHECK(table_error(*run) < 30 * tolerance);
      }
      const double x = run->bodies()[0].position.x() - 0.3, v = run->bodies()[0].velocity.x();
      const double pull = x > 0 ? 2.4 + 50 * x : 8 * (x + 0.3);
      CHECK(std::abs(run->forces().joints[0].drive + pull) < 1e-9);
      CHECK(std::abs(v * v + run->diagnostics().potential_energy - 1.44) < 150 * tolerance);
    }
}

TEST_CASE("tables of stiffness and damping in steps are of order 1, and stable at any step") {
  double last = 0;
  for (const double step : {1e-2, 1e-3, 1e-4}) {
    const auto run = table_engine(tabled(kCaught), EngineKind::stepping, step);
    run->advance(0.5);
    double now = table_error(*run);
    run->advance(0.75);
    now = std::max(now, table_error(*run));
    INFO(step << " " << now);
    CHECK(now < 10 * step);
    if (last > 0) CHECK((last / now > 7 && last / now < 13));
    last = now;
  }
  Scene stiff = tabled(kCaught);
  for (Joint& joint : stiff.joints) {
    for (auto& row : joint.spring->stiffness_table) row[1] *= 1e9;
    for (auto& row : joint.spring->damping_table) row[1] *= 1e9;
  }
  const auto run = table_engine(stiff, EngineKind::stepping, 0.1);
  for (int k = 1; k <= 20; ++k) {
    run->advance(0.1 * k);
    CHECK(std::abs(run->bodies()[0].position.x()) < 0.2);
  }
  CHECK(run->bodies()[0].velocity.norm() < 1e-3);
  CHECK(run->bodies()[1].angular_velocity.norm() < 1e-3);
}

TEST_CASE("energy is kept with the work of tabulated dampers counted") {
  Scene scene = tabled(kCaught);
  scene.invariants.emplace_back();
  scene.invariants.back().kind = InvariantKind::energy;
  const auto run = table_engine(scene, EngineKind::smooth, 1e-8);
  run->advance(0.75);
  CHECK(table_error(*run) < 1e-6);
}

TEST_CASE("a table acts around the rest, on both sides, and turns with an angle") {
  Scene scene = tabled(kCaught);
  Joint& shaft = scene.joints[1];
  shaft.spring->damping_table.clear();
  shaft.spring->stiffness_table = {{0.5, 1}, {1, 4}};
  scene.bodies[1].angular_velocity.setZero();
  for (const auto& [angle, moment] :
       {std::pair{0.0, 0.8}, std::pair{1.2, -2.8}, std::pair{-0.4, 2.8}, std::pair{2.0, -4.0}}) {
    shaft.spring->rest = 0.4 - angle + 2 * M_PI;  // a turn away is the same
    const auto run = table_engine(scene, EngineKind::smooth, 1e-8);
    CHECK(std::abs(run->forces().joints[1].drive - moment) < 1e-9);
  }
}

/// Steps of a ball have an error of first order at t, and a table as steep as a wall stops it.
template <class Error>
void check_steps_of_ball(Scene scene, double t, const Error& error) {
  double last = 0;
  for (const double step : {1e-2, 1e-3, 1e-4}) {
    const auto run = table_engine(scene, EngineKind::stepping, step);
    run->advance(t);
    const double now = error(*run);
    INFO(step << " " << now);
    CHECK(now < 10 * step);
    if (last > 0) CHECK((last / now > 6 && last / now < 14));
    last = now;
  }
  JointSpring& spring = *scene.joints[0].spring;
  for (auto* table : {&spring.stiffness_table, &spring.damping_table})
    for (auto& row : *table) row[1] *= 1e9;
  const auto run = table_engine(scene, EngineKind::stepping, 0.1);
  run->advance(2);
  CHECK(run->bodies()[0].angular_velocity.norm() < 1e-3);
}

TEST_CASE("a ball against a table turns about its axis by the closed form") {
  const Scene scene = tabled(kTabledBall);
  for (const EngineKind engine : {EngineKind::smooth, EngineKind::event})
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const auto run = table_engine(scene, engine, tolerance);
      for (const double t : {0.1, 0.3, 0.5}) {
        run->advance(t);
        INFO(tolerance << " " << t << ", error " << ball_error(*run));
        CHECK(ball_error(*run) < 100 * tolerance);
      }
      const double angle = turned_at(0.5).first, stored = 0.2 + 2 * (angle - 0.2);
      CHECK(angle > 0.25);
      CHECK(std::abs(run->diagnostics().potential_energy - stored) < 100 * tolerance);
      CHECK((run->forces().joints[0].moment + 2 * kTurnAxis).norm() < 1e-4);
    }
  check_steps_of_ball(scene, 0.5, ball_error);
}

TEST_CASE("a ball against a damping table slows by the closed form") {
  // 1.5 N m from 1 rad/s on, less below, from 3 rad/s.
  Scene scene = tabled(kTabledBall);
  scene.joints[0].spring->stiffness_table.clear();
  scene.joints[0].spring->damping_table = {{1, 1.5}, {4, 1.5}};
  scene.bodies[0].angular_velocity *= 2;
  constexpr double kSlows = 1.5 / 0.5, kUntil = (3 - 1) / kSlows;
  const auto speed = [](double t) {
    return t < kUntil ? 3 - kSlows * t : std::exp(-kSlows * (t - kUntil));
  };
  const auto angle = [&](double t) {
    const double s = std::min(t, kUntil), way = 3 * s - 0.5 * kSlows * s * s;
    return t < kUntil ? way : way + (1 - speed(t)) / kSlows;
  };
  const auto error = [&](const Engine& run) {
    const Eigen::AngleAxisd now(run.bodies()[0].orientation);
    return std::max((now.angle() * now.axis() - angle(run.time()) * kTurnAxis).norm(),
                    (run.bodies()[0].angular_velocity - speed(run.time()) * kTurnAxis).norm());
  };
  for (const EngineKind engine : {EngineKind::smooth, EngineKind::event})
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const auto run = table_engine(scene, engine, tolerance);
      for (const double t : {0.3, 0.9, 1.5}) {
        run->advance(t);
        INFO(tolerance << " " << t << ", error " << error(*run));
        CHECK(error(*run) < 100 * tolerance);
      }
      CHECK((run->forces().joints[0].moment + 1.5 * speed(1.5) * kTurnAxis).norm() < 1e-4);
    }
  check_steps_of_ball(scene, 1.5, error);
}

TEST_CASE("a ball with both tables loses the energy that its damping table takes") {
  Scene scene = tabled(kTabledBall);
  scene.bodies[0].inertia = Eigen::Vector3d(0.5, 0.3, 0.4).asDiagonal();
  scene.joints[0].spring->damping_table = {{0.5, 0.1}, {2, 0.6}};
  scene.invariants.emplace_back();
  scene.invariants.back().kind = InvariantKind::energy;
  const auto smooth = table_engine(scene, EngineKind::smooth, 1e-9);
  scene.invariants.clear();
  const auto event = table_engine(scene, EngineKind::event, 1e-9);
  const auto steps = table_engine(scene, EngineKind::stepping, 1e-4);
  for (Engine* each : {smooth.get(), event.get(), steps.get()}) each->advance(1);
  CHECK((smooth->bodies()[0].angular_velocity - event->bodies()[0].angular_velocity).norm() < 1e-6);
  CHECK((smooth->bodies()[0].angular_velocity - steps->bodies()[0].angular_velocity).norm() < 1e-3);
  CHECK(smooth->diagnostics().kinetic_energy + smooth->diagnostics().potential_energy < 0.5);
}

TEST_CASE("the turn of a ball of any inertia keeps the energy that a table with play stores") {
  Scene scene = tabled(kTabledBall);
  scene.bodies[0].inertia = Eigen::Vector3d(0.5, 0.3, 0.4).asDiagonal();
  scene.joints[0].spring->stiffness_table = {{0.1, 0}, {0.4, 3}, {1, 30}};
  for (const EngineKind engine : {EngineKind::smooth, EngineKind::event}) {
    const auto run = table_engine(scene, engine, 1e-9);
    const double before = run->diagnostics().kinetic_energy;
    run->advance(2);
    CHECK(run->diagnostics().potential_energy > 0.01);
    CHECK(std::abs(run->diagnostics().kinetic_energy + run->diagnostics().potential_energy -
                   before) < 1e-6);
  }
}

TEST_CASE("tables of springs are written, read again and refused by name") {
  const Scene scene = tabled(kCaught);
  const Scene again = tabled(write_scene(scene));
  CHECK(again.joints[0].spring->stiffness_table == scene.joints[0].spring->stiffness_table);
  CHECK(again.joints[1].spring->damping_table == scene.joints[1].spring->damping_table);
  const std::string hinge = "kind = \"hinge\"\nat = [0, 0, 0]\naxis = [0, 0, 1]\n";
  CHECK(table_refusal("stiffness_table = [[1, 2]]", hinge).empty());
  for (const char* table :
       {"stiffness = 1, stiffness_table = [[1, 2]]", "stiffness_table = []",
        "stiffness_table = [[0, 0], [1, 2]]", "stiffness_table = [[1, 2], [1, 3]]",
        "stiffness_table = [[1, 2], [2, 1]]", "stiffness_table = [[1, 0]]",
        "stiffness_table = [[1, 2, 3]]", "stiffness_table = 3", "stiffness_table = [[-1, 2]]"}) {
    INFO(table);
    CHECK(table_refusal(table, hinge).find("stiffness_table") != std::string::npos);
  }
  const Scene ball = tabled(kTabledBall);
  CHECK(tabled(write_scene(ball)).joints[0].spring->stiffness_table ==
        ball.joints[0].spring->stiffness_table);
  bool planned = false;
  for (const Effect& each : make_plan(ball).effects)
    planned = planned || (each.name == "tables of balls" && each.detail == "1 joint");
  CHECK(planned);
  CHECK(table_refusal("damping_table = [[1, 2]]", "kind = \"ball\"\nat = [0, 0, 0]\n").empty());
}
