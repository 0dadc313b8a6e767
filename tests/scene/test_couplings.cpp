// Couplings of joints. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using Eigen::Vector3d;

namespace coupled {

const char* const kEngines[] = {"smooth", "event"};

std::string with(const std::string& engine, double tolerance, double end, const std::string& more) {
  return "[scene]\nengine = \"" + engine + "\"\nend = " + std::to_string(end) + "\n" + more + "[" +
         engine + "]\ntolerance = " + std::to_string(tolerance) + "\n";
}

Scene scene_of(const std::string& engine, double tolerance, double end, const std::string& text,
               const std::string& more = "") {
  Scene scene = parse_scene(with(engine, 1e-3, end, more) + text, "test");
  if (scene.smooth) scene.smooth->tolerance = tolerance;
  if (scene.event) scene.event->tolerance = tolerance;
  return scene;
}

std::string wheel(const std::string& name, double inertia, double x, const std::string& on,
                  const std::string& more = "") {
  const std::string place = "[" + std::to_string(x) + ", 0, 0]";
  return "[[body]]\nname = \"" + name + "\"\nmass = 1\ninertia = [0.4, 0.4, " +
         std::to_string(inertia) + "]\nposition = " + place + "\n" + more +
         "\n[[joint]]\nname = \"" + name + "\"\nkind = \"hinge\"\nbodies = [\"" + name + "\", \"" +
         on + "\"]\nat = " + place + "\naxis = [0, 0, 1]\n";
}

std::string coupling(const std::string& joints, const std::string& values) {
  return "[[coupling]]\njoints = [" + joints + "]\n" + values + "\n";
}

std::string torque(const std::string& body, double size) {
  return "[[load]]\nbody = \"" + body + "\"\ntorque = [0, 0, " + std::to_string(size) + "]\n";
}

double spin(const Engine& engine, std::size_t body) {
  return engine.bodies()[body].angular_velocity.z();
}

// Gears of ratio 3 : 1 on a frame that turns about a pivot, all of them free to.
const std::string kPlanetary =
    "[[body]]\nname = \"frame\"\nmass = 2\ninertia = [0.4, 0.4, 0.5]\n"
    "[[joint]]\nname = \"pivot\"\nkind = \"hinge\"\nbodies = [\"frame\", \"world\"]\n"
    "at = [0, 0, 0]\naxis = [0, 0, 1]\n" +
    wheel("sun", 0.2, 0, "frame") + wheel("planet", 0.1, 0.5, "frame") +
    coupling("\"planet\", \"sun\"", "ratio = -3");

}  // namespace coupled

using namespace coupled;

TEST_CASE("gears turn against each other by their ratio, over many turns") {
  const double ratio = -1 / 3.0, inertia = 0.4 + 0.1 / 9, accelerated = 5 / inertia;
  const std::string text = wheel("a", 0.4, 0, "world") + wheel("b", 0.1, 1, "world") +
                           coupling("\"b\", \"a\"", "ratio = -0.3333333333333333") + torque("a", 5);
  for (const char* which : kEngines)
    for (const double tolerance : {1e-6, 1e-9}) {
      const auto engine = make_engine(scene_of(which, tolerance, 4, text));
      engine->advance(4);  // 15 turns
      INFO(which << " " << tolerance);
      CHECK(std::abs(spin(*engine, 0) - accelerated * 4) < 300 * tolerance);
      CHECK(std::abs(spin(*engine, 1) - ratio * accelerated * 4) < 300 * tolerance);
      CHECK(engine->diagnostics().drift < 1e-9);
      const Forces forces = engine->forces();
      CHECK(std::abs(forces.joints[1].drive - 0.1 * ratio * accelerated) < 1e-6);
      CHECK(std::abs(forces.joints[0].drive - 0.1 / 9 * -accelerated) < 1e-6);
    }
  double last = 0;
  for (const double step : {1e-2, 1e-3}) {
    Scene scene = scene_of("stepping", 1e-9, 4, text);
    scene.stepping->step = step;
    const auto engine = make_engine(scene);
    engine->advance(4);
    CHECK(std::abs(spin(*engine, 0) - accelerated * 4) < 1e-6);
    CHECK(std::abs(spin(*engine, 1) - ratio * accelerated * 4) < 1e-6);
    CHECK(engine->diagnostics().drift < 1e-9);
    last = std::abs(engine->forces().joints[1].drive - 0.1 * ratio * accelerated);
  }
  CHECK(last < 1e-5);
}

TEST_CASE("a sun and a planet on a free frame keep energy and turn by their equations") {
  // theta_p = -3 theta_s, seen from the frame f: T = (I_f + m r^2 + I_s + I_p) f'^2 / 2 + (I_s - 3
  // I_p) f' s' + (I_s + 9 I_p) s'^2 / 2.
  const double a = 0.5 + 0.25 + 0.2 + 0.1, b = 0.2 - 0.3, c = 0.2 + 0.9, t = 3;
  // 2 N m on the sun's body: f and s both get it.
  const double det = a * c - b * b, f2 = 2 * (c - b) / det, s2 = 2 * (a - b) / det;
  const std::string text = kPlanetary + torque("sun", 2);
  for (const char* which : kEngines)
    for (const double tolerance : {1e-6, 1e-9}) {
      const auto engine = make_engine(scene_of(which, tolerance, t, text));
      engine->advance(t);
      INFO(which << " " << tolerance);
      CHECK(std::abs(spin(*engine, 0) - f2 * t) < 300 * tolerance);
      CHECK(std::abs(spin(*engine, 1) - (f2 + s2) * t) < 300 * tolerance);
      CHECK(std::abs(spin(*engine, 2) - (f2 - 3 * s2) * t) < 300 * tolerance);
    }
  Scene scene = scene_of("stepping", 1e-9, t, text);
  scene.stepping->step = 1e-3;
  const auto engine = make_engine(scene);
  engine->advance(t);
  CHECK(std::abs(spin(*engine, 0) - f2 * t) < 1e-2);
  CHECK(std::abs(spin(*engine, 1) - (f2 + s2) * t) < 1e-2);
}

TEST_CASE("fifty wheels in a train turn as one, with rows by their entries") {
  std::string text;
  const int n = 50;
  for (int k = 0; k < n; ++k) text += wheel("w" + std::to_string(k), 0.1, k, "world");
  for (int k = 1; k < n; ++k)
    text += coupling("\"w" + std::to_string(k) + "\", \"w" + std::to_string(k - 1) + "\"",
                     "ratio = -1\nname = \"c" + std::to_string(k) + "\"");
  text += torque("w0", 5);
  const auto engine = make_engine(scene_of("smooth", 1e-7, 2, text));
  engine->advance(2);
  for (int k = 0; k < n; ++k)
    CHECK(std::abs(spin(*engine, static_cast<std::size_t>(k)) - (k % 2 ? -2 : 2)) < 1e-5);
  CHECK(engine->diagnostics().drift < 1e-8);
}

TEST_CASE("a polynomial of a moved joint gives place, speed and force of the other") {
  const std::string text =
      "[[body]]\nname = \"cam\"\nmass = 1\ninertia = [0.1, 0.1, 0.1]\n"
      "angular_velocity = [0, 0, 0.8]\n"
      "[[joint]]\nname = \"cam\"\nkind = \"hinge\"\nbodies = [\"cam\", \"world\"]\nat = [0, 0, "
      "0]\naxis = [0, 0, 1]\nmotion = { rate_rad = 0.8 }\n"
      "[[body]]\nname = \"lift\"\nmass = 2\ninertia = [0.1, 0.1, 0.1]\n"
      "[[joint]]\nname = \"lift\"\nkind = \"slider\"\nbodies = [\"lift\", \"world\"]\naxis = [0, "
      "0, 1]\n" +
      coupling("\"lift\", \"cam\"", "polynomial = [0, 0.3, -0.1]");
  for (const char* which : {"smooth", "event", "stepping"}) {
    Scene scene = scene_of(which, 1e-9, 2, text);
    if (scene.stepping) scene.stepping->step = 1e-3;
    const bool steps = scene.stepping.has_value();
    const auto engine = make_engine(scene);
    engine->advance(2);
    const double s = 1.6, s1 = 0.8;
    INFO(which);
    CHECK(std::abs(engine->bodies()[1].position.z() - (0.3 * s * s - 0.1 * s * s * s)) < 1e-8);
    CHECK(std::abs(engine->bodies()[1].velocity.z() - (0.6 * s - 0.3 * s * s) * s1) < 1e-7);
    const double force = 2 * (0.6 - 0.6 * s) * s1 * s1;
    CHECK(std::abs(engine->forces().joints[1].drive - force) < (steps ? 1e-3 : 1e-6));
  }
}

TEST_CASE("a cam that is free to turn keeps the energy of its follower, from a slope of 0 on") {
  const std::string text =
      wheel("cam", 0.05, 0, "world", "angular_velocity = [0, 0, 1]") +
      "[[body]]\nname = \"lift\"\nmass = 1\ninertia = [0.1, 0.1, 0.1]\n[[joint]]\nname = "
      "\"lift\"\nkind = \"slider\"\nbodies = [\"lift\", \"world\"]\naxis = [0, 0, 1]\n" +
      coupling("\"lift\", \"cam\"", "polynomial = [0, 0.02]");
  for (const char* which : kEngines) {
    const auto engine = make_engine(scene_of(which, 1e-9, 3, text, "gravity = [0, 0, -9.81]\n"));
    for (const double t : {0.5, 1.0, 3.0}) {
      engine->advance(t);
      const double z = engine->bodies()[1].position.z();
      const double angle =
          2 * std::atan2(engine->bodies()[0].orientation.z(), engine->bodies()[0].orientation.w());
      const double energy = engine->diagnostics().kinetic_energy + 9.81 * z;
      INFO(which << " " << t);
      CHECK(std::abs(energy - 0.025) < 1e-8);
      CHECK(std::abs(z - 0.02 * angle * angle) < 1e-9);
    }
    CHECK(engine->counts().steps < 2000);
  }
}

TEST_CASE("couplings are written, read again and refused by name") {
  const Scene scene = scene_of("smooth", 1e-6, 1, kPlanetary);
  const Scene again = parse_scene(write_scene(scene), "again");
  REQUIRE(again.couplings.size() == 1);
  CHECK(again.couplings[0].joints == scene.couplings[0].joints);
  CHECK(again.couplings[0].polynomial == std::vector<double>{-3});
  const struct {
    const char *joints, *values, *words;
  } wrong[] = {{"\"planet\", \"sun\"", "", "ratio"},
               {"\"planet\", \"sun\"", "ratio = 1\nweights = [1, 2]", "one of the three"},
               {"\"planet\", \"sun\"", "ratio = 0", "weight is 0"},
               {"\"planet\", \"sun\"", "weights = [1, 2, 3]", "weights"},
               {"\"planet\", \"sun\", \"pivot\"", "polynomial = [1, 2]", "of two joints"},
               {"\"planet\", \"planet\"", "ratio = 1", "there twice"},
               {"\"planet\", \"son\"", "ratio = 1", "did you mean"},
               {"\"planet\"", "ratio = 1", "two names"},
               {"\"planet\", \"held\"", "ratio = 1", "no hinge and no slider"},
               {"\"planet\", \"sun\"", "ratio = 1\nteeth = 7", "teeth"}};
  const std::string held =
      "[[body]]\nname = \"x\"\nmass = 1\ninertia = [1, 1, 1]\n[[joint]]\nname = \"held\"\nkind = "
      "\"ball\"\nbodies = [\"x\", \"world\"]\nat = [0, 0, 0]\n";
  for (const auto& each : wrong) {
    const std::string said = tether::test::thrown<SceneError>([&] {
      scene_of("smooth", 1e-6, 1, kPlanetary + held + coupling(each.joints, each.values));
    });
    INFO(each.joints << " " << each.values << " " << said);
    CHECK(said.find(each.words) != std::string::npos);
    const std::size_t named = said.find("coupling \"");
    CHECK((named == std::string::npos || said.find("coupling \"", named + 1) == std::string::npos));
  }
}
