// Cables through rings. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::scene;

namespace cables {

using Eigen::Vector3d;

constexpr double kFall = 9.81;

std::string hanging(const char* name, double mass, double x, double z) {
  return "[[body]]\nname = \"" + std::string(name) + "\"\nmass = " + std::to_string(mass) +
         "\ninertia = [0.1, 0.2, 0.3]\nposition = [" + std::to_string(x) + ", 0, " +
         std::to_string(z) + "]\n";
}

Scene cable_scene(const std::string& text, double end = 2) {
  return parse_scene("[scene]\nend = " + std::to_string(end) + "\ngravity = [0, 0, -9.81]\n" + text,
                     "test");
}

/// m s'' = m g - k s - c s' from s = 0 on: `at` tells s and s' after t.
struct Stretch {
  double mass, k, c, speed, gravity = kFall;
  std::pair<double, double> at(double t) const {
    const double a = c / (2 * mass), w = std::sqrt(k / mass - a * a), rest = mass * gravity / k;
    const double p = -rest, q = (speed + a * p) / w;
    const double decay = std::exp(-a * t), cosine = std::cos(w * t), sine = std::sin(w * t);
    return {rest + decay * (p * cosine + q * sine),
            decay * ((w * q - a * p) * cosine - (w * p + a * q) * sine)};
  }
};

// A pulley of two rings; the rope starts with half of the stretch that it has at rest.
constexpr double kHeavy = 3, kLight = 2, kRope = 600,
                 kReduced = kHeavy * kLight / (kHeavy + kLight);
constexpr double kAtRest = 2 * kFall * kReduced / kRope;
const Scene kAtwood = [] {
  Scene scene = cable_scene(hanging("heavy", kHeavy, -0.2, -2) + hanging("light", kLight, 0.2, -5) +
                            R"(
[output]
forces = true
[[cable]]
name = "rope"
bodies = ["heavy", "world", "world", "light"]
at = [[-0.2, 0, -2], [-0.2, 0, 0], [0.2, 0, 0], [0.2, 0, -5]]
stiffness = 600
)");
  scene.springs[0].rest = 7.4 - 0.5 * kAtRest;
  return scene;
}();

double atwood_stretch(double t) {
  return kAtRest * (1 - 0.5 * std::cos(std::sqrt(kRope / kReduced) * t));
}

double atwood_error(const Engine& engine) {
  const double t = engine.time(), more = atwood_stretch(t) - 0.5 * kAtRest,
               fall = 0.5 * (kHeavy - kLight) * kFall * t * t, both = kHeavy + kLight;
  return std::max(std::abs(engine.bodies()[0].position.z() + 2 + (kLight * more + fall) / both),
                  std::abs(engine.bodies()[1].position.z() + 5 + (kHeavy * more - fall) / both));
}

// A load that falls from 0.5 m below the hook; 2 m of cord catch it.
Scene bungee(double damping) {
  return cable_scene(hanging("jumper", 70, 0, -0.5) +
                         "[[cable]]\nname = \"cord\"\nbodies = [\"world\", \"jumper\"]\n"
                         "at = [[0, 0, 0], [0, 0, -0.5]]\nlength = 2\nstiffness = 900\ndamping = " +
                         std::to_string(damping) + "\n",
                     10);
}

std::unique_ptr<Engine> cable_engine(Scene scene, EngineKind engine, double accuracy) {
  scene.engine = engine;
  if (engine == EngineKind::smooth)
    scene.smooth.emplace().tolerance = accuracy;
  else if (engine == EngineKind::event)
    scene.event.emplace().tolerance = accuracy;
  else
    scene.stepping.emplace().step = accuracy;
  return make_engine(scene);
}

constexpr EngineKind kCableEngines[] = {EngineKind::smooth, EngineKind::event};

double first_contact() { return std::sqrt(2 * 1.5 / kFall); }

std::string cable_refusal(const std::string& bodies, const std::string& rest) {
  return tether::test::thrown<SceneError>([&] {
    cable_scene(
        hanging("a", 1, 0, 0) + hanging("b", 1, 1, 0) +
        "[[spring]]\nname = \"coil\"\nbodies = [\"a\", \"b\"]\nat = [[0, 0, 0], [1, 0, 0]]\n"
        "stiffness = 1\n[[cable]]\nname = \"rope\"\nbodies = " +
        bodies + "\n" + rest);
  });
}

}  // namespace cables

using namespace cables;

TEST_CASE("Atwood's machine on an elastic rope: motion, tension and energy by tolerance") {
  for (const EngineKind engine : kCableEngines)
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const auto run = cable_engine(kAtwood, engine, tolerance);
      const double before = run->diagnostics().kinetic_energy + run->diagnostics().potential_energy;
      for (const double t : {0.1, 0.35, 0.8}) {
        run->advance(t);
        INFO(tolerance << " " << t << ", error " << atwood_error(*run));
        CHECK(atwood_error(*run) < 30 * tolerance);
        const double tension = run->forces().springs[0].tension;
        CHECK(std::abs(tension - kRope * atwood_stretch(t)) < kRope * 60 * tolerance);
      }
      const double after = run->diagnostics().kinetic_energy + run->diagnostics().potential_energy;
      CHECK(std::abs(after - before) < 3000 * tolerance);
    }
}

TEST_CASE("cables in steps are of order 1") {
  double last = 0, last_fall = 0;
  for (const double step : {4e-3, 1e-3, 2.5e-4}) {
    const auto run = cable_engine(kAtwood, EngineKind::stepping, step);
    run->advance(0.4);
    const double now = atwood_error(*run);
    const auto fall = cable_engine(bungee(150), EngineKind::stepping, step);
    fall->advance(0.8);
    const Stretch caught{70, 900, 150, kFall * first_contact()};
    const double there =
        std::abs(fall->bodies()[0].position.z() + 2 + caught.at(0.8 - first_contact()).first);
    INFO(step << " " << now << " " << there);
    CHECK(now < 10 * step);
    CHECK(there < 10 * step);
    if (last > 0) CHECK((last / now > 3 && last / now < 5.5));
    if (last_fall > 0) CHECK(last_fall / there > 2);
    last = now;
    last_fall = there;
  }
}

TEST_CASE("a slack cord exerts nothing, catches a falling body and lets it fly again") {
  const double speed = kFall * first_contact(), w = std::sqrt(900 / 70.0), rest = 70 * kFall / 900;
  const double lowest = 2 + rest + std::hypot(rest, speed / w);
  // By energy: all of the fall is in the cord.
  CHECK(std::abs(70 * kFall * (lowest - 0.5) - 450 * (lowest - 2) * (lowest - 2)) < 1e-9);
  const double half = (M_PI - std::atan2(speed / w, rest)) / w, off = first_contact() + 2 * half;
  for (const EngineKind engine : kCableEngines)
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      INFO(tolerance);
      const auto run = cable_engine(bungee(0), engine, tolerance);
      run->advance(0.5 * first_contact());
      CHECK(run->forces().springs[0].tension == 0);
      // No part of it is the cord's.
      CHECK(std::abs(run->diagnostics().potential_energy -
                     70 * kFall * run->bodies()[0].position.z()) < 1e-9);
      run->advance(first_contact() + half);
      CHECK(std::abs(run->bodies()[0].position.z() + lowest) < 30 * tolerance);
      CHECK(std::abs(run->bodies()[0].velocity.z()) < 100 * tolerance);
      run->advance(off + 0.5 * first_contact());
      const double t = 0.5 * first_contact();
      CHECK(run->forces().springs[0].tension == 0);
      CHECK(std::abs(run->bodies()[0].position.z() + 2 - speed * t + 0.5 * kFall * t * t) <
            100 * tolerance);
    }
}

TEST_CASE("a damped cord is caught with a jump of its tension, and does not push on its way back") {
  const Stretch caught{70, 900, 60, kFall * first_contact()};
  // The tension vanishes at k s + c s' = 0, before s = 0.
  double low = 0, high = 0;
  for (double t = 0.5; high == 0 && t < 3; t += 1e-3) {
    const auto [s, rate] = caught.at(t);
    if (900 * s + 60 * rate <= 0) low = t - 1e-3, high = t;
  }
  for (int k = 0; k < 60; ++k) {
    const double t = 0.5 * (low + high);
    const auto [s, rate] = caught.at(t);
    (900 * s + 60 * rate > 0 ? low : high) = t;
  }
  const auto [s, rate] = caught.at(low);
  CHECK(s > 0);
  for (const EngineKind engine : kCableEngines)
    for (const double tolerance : {1e-6, 1e-8}) {
      const auto run = cable_engine(bungee(60), engine, tolerance);
      run->advance(first_contact() + 0.3);
      INFO(tolerance << " " << run->bodies()[0].position.z() + 2 + caught.at(0.3).first);
      CHECK(std::abs(run->bodies()[0].position.z() + 2 + caught.at(0.3).first) < 100 * tolerance);
      const double t = 0.02;
      run->advance(first_contact() + low + t);
      CHECK(run->forces().springs[0].tension == 0);
      CHECK(std::abs(run->bodies()[0].position.z() + 2 + s + rate * t + 0.5 * kFall * t * t) <
            100 * tolerance);
    }
}

TEST_CASE("a block and tackle carries twice the tension") {
  const double M = 5, m = 2, k = 800, together = 4 / M + 1 / m, rest = 3 * kFall / (together * k);
  Scene scene = cable_scene(hanging("block", M, 0, -2) + hanging("weight", m, 0.3, -4) + R"(
[[cable]]
bodies = ["world", "block", "block", "world", "world", "weight"]
at = [[-0.1, 0, 0], [-0.1, 0, -1.9], [0.1, 0, -1.9], [0.1, 0, 0], [0.3, 0, 0], [0.3, 0, -4]]
stiffness = 800
)");
  CHECK(scene.springs[0].name == "cable 1");
  scene.springs[0].rest = 8.2 - 0.5 * rest;
  for (const EngineKind engine : kCableEngines) {
    const auto run = cable_engine(scene, engine, 1e-9);
    const double t = 0.5;
    run->advance(t);
    const double more = 0.5 * rest * (1 - std::cos(std::sqrt(together * k) * t));
    const double falls = ((M - 2 * m) * 0.5 * kFall * t * t + 2 * m * more) / (M + 4 * m);
    CHECK(std::abs(run->bodies()[0].position.z() + 2 + falls) < 1e-7);
    CHECK(std::abs(run->bodies()[1].position.z() + 4 + more - 2 * falls) < 1e-7);
    CHECK(std::abs(run->bodies()[0].angular_velocity.norm()) < 1e-7);
    CHECK(std::abs(run->forces().springs[0].tension - k * (0.5 * rest + more)) < 1e-4);
  }
}

TEST_CASE("a winch hauls a load, and a kept energy counts its work and that of the damping") {
  const double m = 4, k = 400, c = 8, w = -0.1;
  Scene scene = cable_scene(hanging("load", m, 0, -3) + R"(
[[cable]]
name = "wire"
bodies = ["world", "load"]
at = [[0, 0, 0], [0, 0, -3]]
stiffness = 400
damping = 8
winch = -0.1
)");
  scene.springs[0].rest = 3 - m * kFall / k;
  const Stretch law{m, k, c, -w, 0};
  for (const bool kept : {false, true}) {
    if (kept) {
      scene.invariants.emplace_back();
      scene.invariants.back().kind = InvariantKind::energy;
    }
    const auto run = cable_engine(scene, EngineKind::smooth, 1e-9);
    for (const double t : {0.3, 1.0, 2.0}) {
      run->advance(t);
      const auto [more, rate] = law.at(t);
      CHECK(std::abs(run->bodies()[0].position.z() + 3 + w * t + more) < 1e-7);
      CHECK(std::abs(run->forces().springs[0].tension - (m * kFall + k * more + c * rate)) < 1e-4);
    }
  }
  scene.invariants.clear();
  const auto steps = cable_engine(scene, EngineKind::stepping, 1e-4);
  steps->advance(1);
  CHECK(std::abs(steps->bodies()[0].position.z() + 3 + w + law.at(1).first) < 1e-4);
}

TEST_CASE("cables are written, read again, planned, and refused by name") {
  Scene scene = kAtwood;
  scene.springs[0].cable->winch = 0.25;
  const Scene again = parse_scene(write_scene(scene), "again");
  CHECK(write_scene(again) == write_scene(scene));
  REQUIRE(again.springs.size() == 1);
  REQUIRE(again.springs[0].cable);
  CHECK(again.springs[0].cable->rings.size() == 2);
  CHECK(again.springs[0].cable->winch == 0.25);
  CHECK(again.springs[0].rest == scene.springs[0].rest);
  bool planned = false;
  for (const Effect& each : make_plan(scene).effects)
    planned = planned || (each.name == "cables" && each.detail == "1 cable through 2 rings");
  CHECK(planned);
  const std::string points = "at = [[0, 0, 0], [1, 0, 0]]\n", stiff = "stiffness = 1\n";
  CHECK(cable_refusal("[\"a\", \"b\"]", points + stiff).empty());
  CHECK(cable_refusal("[\"world\", \"a\", \"world\"]",
                      "at = [[0, 0, 1], [0, 0, 0], [0, 1, 1]]\n" + stiff)
            .empty());
  const auto refused = [&](const std::string& bodies, const std::string& rest, const char* field) {
    const std::string message = cable_refusal(bodies, rest);
    INFO(bodies << " " << rest << ": " << message);
    CHECK(message.find("cable \"rope\"") != std::string::npos);
    CHECK(message.find(field) != std::string::npos);
  };
  refused("[\"a\"]", points + stiff, "bodies");
  refused("[\"a\", \"c\"]", points + stiff, "there is no body \"c\"");
  refused("[\"world\", \"world\"]", points + stiff, "bodies");
  refused("[\"a\", \"a\"]", points + stiff, "bodies");
  refused("[\"a\", \"b\", \"world\"]", points + stiff, "at");
  refused("[\"a\", \"b\"]", "at = [[1, 0, 0], [1, 0, 0]]\n" + stiff, "at");
  refused("[\"a\", \"b\"]", stiff, "at");
  refused("[\"a\", \"b\"]", points, "stiffness");
  refused("[\"a\", \"b\"]", points + "stiffness = 0\n", "stiffness");
  refused("[\"a\", \"b\"]", points + stiff + "damping = -1\n", "damping");
  refused("[\"a\", \"b\"]", points + stiff + "length = 0\n", "length");
  refused("[\"a\", \"b\"]", points + stiff + "rest = 1\n", "rest");
  refused("[\"a\", \"b\"]", points + stiff + "winch = -0.6\n", "winch");
  refused("[\"a\", \"b\"]", points + stiff + "winch = nan\n", "winch");
  const std::string message =
      tether::test::thrown([] { cable_engine(bungee(0), EngineKind::stepping, 1); });
  CHECK(message.find("cable \"cord\": a step of 1 s is too long") != std::string::npos);
}
