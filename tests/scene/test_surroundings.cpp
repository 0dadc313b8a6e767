// Wind, the gradient of gravity, and loads in axes of bodies. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <iomanip>
#include <sstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using Eigen::Vector3d;

namespace surroundings {

Scene surrounded(const std::string& text) { return parse_scene(text, "test"); }

std::unique_ptr<Engine> smooth_or_event(Scene scene, bool events, double tolerance) {
  scene.engine = events ? EngineKind::event : EngineKind::smooth;
  if (events)
    scene.event.emplace().tolerance = tolerance;
  else
    scene.smooth.emplace().tolerance = tolerance;
  return make_engine(scene);
}

std::unique_ptr<Engine> stepped(Scene scene, double step) {
  scene.engine = EngineKind::stepping;
  scene.stepping.emplace().step = step;
  return make_engine(scene);
}

double energy_in(const Engine& engine) {
  const Diagnostics d = engine.diagnostics();
  return d.kinetic_energy + d.potential_energy;
}

std::string refused_for(const std::string& text) {
  return tether::test::thrown<SceneError>([&] { surrounded(text); });
}

bool holds_text(const std::string& text, const char* part) {
  return text.find(part) != std::string::npos;
}

template <class Error>
void check_all_engines(const Scene& scene, double end, const Error& error) {
  for (const bool events : {false, true})
    for (const double tolerance : {1e-5, 1e-7, 1e-9}) {
      const auto engine = smooth_or_event(scene, events, tolerance);
      engine->advance(end);
      INFO(events << " " << tolerance << ", error " << error(*engine));
      CHECK(error(*engine) < 100 * tolerance);
    }
  double last = 0;
  for (const int steps : {400, 800, 1600}) {
    const auto engine = stepped(scene, end / steps);
    engine->advance(end);
    const double now = error(*engine);
    INFO(steps << " steps, error " << now);
    CHECK(now < 20.0 / steps);
    if (last > 0) CHECK((last / now > 1.8 && last / now < 2.2));
    last = now;
  }
}

const std::string kBalloonAndSail = R"(
[scene]
end = 2
gravity = [0, 0, -9.81]
wind = [6, 0, 0]
[[body]]
name = "balloon"
mass = 0.5
inertia = [0.1, 0.1, 0.1]
drag = { linear = 0.8 }
[[body]]
name = "sail"
mass = 3
inertia = [1, 1, 1]
drag = { quadratic = 0.4 }
[[joint]]
kind = "slider"
bodies = ["sail", "world"]
axis = [1, 0, 0]
)";

double error_in_wind(const Engine& engine) {
  const double t = engine.time(), lag = 0.5 / 0.8 * (1 - std::exp(-0.8 / 0.5 * t));
  const Vector3d balloon(6 * (t - lag), 0, -0.5 * 9.81 / 0.8 * (t - lag));
  const double sail = 6 * t - 3 / 0.4 * std::log(1 + 0.4 * 6 / 3 * t);
  return std::max((engine.bodies()[0].position - balloon).norm(),
                  std::abs(engine.bodies()[1].position.x() - sail));
}

// Held at 2 m from the centre, its long axis along r at the start.
const std::string kHeld = R"(
[scene]
end = 4
[[body]]
name = "bar"
mass = 3
inertia = [0.2, 0.9, 1]
position = [2, 0, 0]
angular_velocity = [0, 0, RATE]
[[joint]]
name = "pin"
kind = "ball"
bodies = ["bar", "world"]
at = [2, 0, 0]
[[central_gravity]]
gravitational_parameter = 5
gradient = true
)";

std::string with_rate(double rate) {
  std::string text = kHeld;
  std::ostringstream number;
  number << std::setprecision(17) << rate;
  return text.replace(text.find("RATE"), 4, number.str());
}

double turn(const BodyState& body) {
  return 2 * std::atan2(body.orientation.z(), body.orientation.w());
}

// A spinner of 1.5 rad/s about z with a thruster along its own x axis, and one of 4 rad/s with a
// torque about its own x axis.
const std::string kThrusters = R"(
[scene]
end = 2
[[body]]
name = "spinner"
mass = 2
inertia = [0.3, 0.3, 0.5]
angular_velocity = [0, 0, 1.5]
[[body]]
name = "tilts"
mass = 2
inertia = [0.3, 0.3, 0.5]
position = [5, 0, 0]
angular_velocity = [0, 0, 4]
[[load]]
body = "spinner"
force = [3, 0, 0]
axes = "body"
[[load]]
body = "tilts"
torque = [0.2, 0, 0]
axes = "body"
)";

double error_of_thrusters(const Engine& engine) {
  const double t = engine.time(), w = 1.5, r = 3 / (2 * w * w);
  const Vector3d place(r * (1 - std::cos(w * t)), r * (w * t - std::sin(w * t)), 0);
  const double rate = (0.5 - 0.3) / 0.3 * 4, s = 0.2 / (0.3 * rate);
  const Vector3d spin(s * std::sin(rate * t), s * (1 - std::cos(rate * t)), 4);
  const BodyState& tilts = engine.bodies()[1];
  return std::max(
      (engine.bodies()[0].position - place).norm(),
      (tilts.orientation.toRotationMatrix().transpose() * tilts.angular_velocity - spin).norm());
}

}  // namespace surroundings

using namespace surroundings;

TEST_CASE("wind takes a balloon along, and a sail with quadratic drag, by their closed forms") {
  check_all_engines(surrounded(kBalloonAndSail), 1.3, error_in_wind);
}

TEST_CASE("energy is kept with the work of wind and thrusters counted, in every form") {
  for (const std::string& text : {kBalloonAndSail, kThrusters}) {
    Scene scene = surrounded(text);
    scene.invariants.emplace_back();
    scene.invariants.back().kind = InvariantKind::energy;
    for (const Formulation form : {Formulation::index1, Formulation::index0}) {
      scene.smooth.emplace().tolerance = 1e-8;
      scene.smooth->formulation = form;
      const auto engine = make_engine(scene);
      engine->advance(2);
      CHECK((text == kThrusters ? error_of_thrusters(*engine) : error_in_wind(*engine)) < 1e-6);
    }
  }
}

TEST_CASE("a bar in the gradient of gravity swings as a pendulum of the double angle") {
  // sin(angle) = k sn(W t), W^2 = 3 GM / r^3 (Iy - Ix) / Iz: the end of its swing after K(k) / W.
  const double W = std::sqrt(3 * 5 / 8.0 * 0.7), k = std::sin(0.8);
  const Scene scene = surrounded(with_rate(k * W));
  const double quarter = std::comp_ellint_1(k) / W;
  check_all_engines(scene, quarter, [&](const Engine& engine) {
    return std::max(std::abs(turn(engine.bodies()[0]) - 0.8),
                    engine.bodies()[0].angular_velocity.norm());
  });
  // At rest along r, and across it: GM m / r^2 and what the extent adds.
  const auto engine = smooth_or_event(scene, false, 1e-8);
  const double along = 5 * 3 / 4.0 + 3 * 5 / 16.0 * ((2.1 - 5 * 0.2) / 2 + 0.2);
  CHECK(std::abs(engine->forces().joints[0].force.x() - along) < 1e-9);
  CHECK(std::abs(engine->diagnostics().potential_energy + 5 * 3 / 2.0 +
                 5 * (2.1 - 3 * 0.2) / (2 * 8)) < 1e-12);
}

TEST_CASE("a tumbling body keeps energy and angular momentum in the gradient of gravity") {
  Scene scene = surrounded(R"(
[scene]
end = 6
[[body]]
name = "rock"
mass = 3
inertia = [0.5, 0.8, 1.1]
position = [2, 0.1, 0.2]
velocity = [0.1, 1.4, 0.3]
angular_velocity = [0.4, -0.7, 1]
[[central_gravity]]
gravitational_parameter = 5
gradient = true
)");
  for (const bool events : {false, true}) {
    const auto engine = smooth_or_event(scene, events, 1e-10);
    const Vector3d start = engine->diagnostics().angular_momentum;
    const Vector3d spin = engine->bodies()[0].angular_velocity;
    const double before = energy_in(*engine);
    engine->advance(6);
    CHECK(std::abs(energy_in(*engine) - before) < 1e-7);
    CHECK((engine->diagnostics().angular_momentum - start).norm() < 1e-7);
    CHECK((engine->bodies()[0].angular_velocity - spin).norm() > 0.1);
  }
}

TEST_CASE("a thruster and a torque that turn with their bodies, by their closed forms") {
  check_all_engines(surrounded(kThrusters), 1.3, error_of_thrusters);
}

TEST_CASE("wind, gradient and axes are planned, written, read again and refused by name") {
  for (const std::string& text : {kBalloonAndSail, with_rate(0.3), kThrusters}) {
    const Scene scene = surrounded(text);
    CHECK(write_scene(surrounded(write_scene(scene))) == write_scene(scene));
  }
  const auto told = [](const std::string& text) {
    std::string all;
    for (const auto& each : make_plan(surrounded(text)).effects)
      all += each.name + ": " + each.detail + "\n";
    return all;
  };
  CHECK(holds_text(told(kBalloonAndSail), "2 bodies, in a wind"));
  CHECK(holds_text(told(with_rate(0.3)), "gravity gradient: 1 centre"));
  CHECK(holds_text(told(kThrusters), "2 loads, 2 of them in axes of bodies"));

  const std::string body = "[[body]]\nname = \"a\"\nmass = 1\ninertia = [1, 1, 1]\n";
  CHECK(holds_text(refused_for("[scene]\nwind = [1, 0, 0]\n" + body), "wind"));
  CHECK(holds_text(refused_for(body + "[[load]]\nbody = \"a\"\nforce = [1, 0, 0]\naxes = \"b\"\n"),
                   "axes"));
  CHECK(holds_text(
      refused_for(body + "[[central_gravity]]\nat = [1, 0, 0]\ngravitational_parameter = "
                         "1\ngradient = 1\n"),
      "gradient"));
}
