// Friction of cables at rings and pulleys. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "engines_of_texts.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;

namespace capstan {

constexpr double kFall = 9.81, kHeavy = 3, kLight = 2, kStiffness = 5000;

std::string weight(const char* name, double mass, double z, double speed = 0, double x = 0) {
  return fmt::format(
      "[[body]]\nname = \"{}\"\nmass = {}\ninertia = [0.1, 0.2, 0.3]\nposition = [{}, 0, {}]\n"
      "velocity = [0, 0, {}]\n",
      name, mass, x, z, speed);
}

/// Two weights on a rope over a drum at the origin, at rest in its tensions, whose sum this is.
std::string atwood(double friction, double tensions, double speed = 0, const char* more = "",
                   const char* ring = "world") {
  return "[scene]\nend = 2\ngravity = [0, 0, -9.81]\n[output]\nforces = true\n" +
         weight("heavy", kHeavy, -2, -speed) + weight("light", kLight, -5, speed) + more +
         fmt::format(
             "[[cable]]\nname = \"rope\"\nbodies = [\"heavy\", \"{}\", \"light\"]\n"
             "at = [[0, 0, -2], [0, 0, 0], [0, 0, -5]]\nstiffness = {}\nlength = {}\n"
             "capstan = {{ friction = {}{} }}\n",
             ring, kStiffness, 7 - 0.5 * tensions / kStiffness, friction,
             *more ? ", radius = 0.1, axis = [0, 1, 0]" : "");
}

double factor(double friction) { return std::exp(friction * M_PI); }

/// Acceleration of the heavy weight, downwards, while the rope slips and T_1 = E T_2.
double slipping(double E) { return kFall * (kHeavy - E * kLight) / (kHeavy + E * kLight); }
double tensions(double E) { return (1 + E) * kLight * (kFall + slipping(E)); }

constexpr EngineKind kBoth[] = {EngineKind::event, EngineKind::stepping};
double accuracy(EngineKind kind) { return kind == EngineKind::event ? 1e-9 : 1e-3; }

double down(const Engine& engine) { return -2 - engine.bodies()[0].position.z(); }
double fall(const Engine& engine) { return -engine.bodies()[0].velocity.z(); }
SpringForce rope(const Engine& engine) { return engine.forces().springs[0]; }

constexpr double kRadius = 0.1, kInertia = 0.02;
std::string pulley_at(int x) {
  return fmt::format(
      "[[body]]\nname = \"pulley\"\nmass = 1\ninertia = [0.05, {1}, 0.05]\n"
      "position = [{0}, 0, 0]\n[[joint]]\nname = \"axle\"\nkind = \"hinge\"\n"
      "bodies = [\"pulley\", \"world\"]\nat = [{0}, 0, 0]\naxis = [0, 1, 0]\n",
      x, kInertia);
}

TEST_CASE("a rope over a drum holds two weights as long as e^(mu pi) is above their ratio") {
  const double least = std::log(kHeavy / kLight) / M_PI;
  for (const EngineKind kind : kBoth) {
    const auto run =
        engine_of(scene_of(atwood(1.001 * least, (kHeavy + kLight) * kFall)), kind, accuracy(kind));
    run->advance(2);
    INFO(run->name());
    CHECK(std::abs(down(*run)) < 1e-9);
    CHECK(std::abs(rope(*run).tension - kHeavy * kFall) < 1e-6);
    CHECK(std::abs(rope(*run).tension_second - kLight * kFall) < 1e-6);
  }
}

TEST_CASE("a rope that slips over a drum has tensions of the ratio e^(mu pi)") {
  const double least = std::log(kHeavy / kLight) / M_PI;
  for (const double part : {0.0, 0.5, 0.99}) {
    const double E = factor(part * least), a = slipping(E);
    for (const EngineKind kind : kBoth) {
      const auto run = engine_of(scene_of(atwood(part * least, tensions(E))), kind, accuracy(kind));
      run->advance(0.8);
      INFO(run->name() << " " << part);
      // Steps by their end velocity: a t dt / 2 is theirs.
      const double late = kind == EngineKind::event ? 1e-8 : 0.51 * a * 0.8 * 1e-3 + 1e-9;
      CHECK(std::abs(down(*run) - 0.5 * a * 0.64) < late);
      CHECK(std::abs(fall(*run) - 0.8 * a) < 1e-7);
      CHECK(std::abs(run->bodies()[1].velocity.z() - 0.8 * a) < 1e-7);
      CHECK(std::abs(rope(*run).tension / rope(*run).tension_second - E) < 1e-8);
      CHECK(std::abs(rope(*run).tension - kHeavy * (kFall - a)) < 1e-5);
    }
  }
}

TEST_CASE(
    "a rope that comes to rest on its drum holds from there on, and its weights swing on it") {
  const double mu = 0.3, E = factor(mu), a = slipping(E), speed = 0.5, stop = -speed / a;
  const double way = -0.5 * speed * speed / a, both = kHeavy + kLight;
  const double w = std::sqrt(4 * kStiffness / both);
  // Held, L_1' = L_2': the mean of the tensions swings about half of the weights.
  const auto swing = [&](double t) {
    return (0.5 * both * kFall - 0.5 * tensions(E)) / (2 * kStiffness) * (1 - std::cos(w * t));
  };
  const auto error = [&](Engine& run) {
    double most = 0;
    for (const double after : {0.05, 0.2}) {
      run.advance(stop + after);
      most = std::max(most, std::abs(down(run) - way - swing(run.time() - stop)));
    }
    return most;
  };
  const Scene scene = scene_of(atwood(mu, tensions(E), speed));
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    const auto run = engine_of(scene, EngineKind::event, tolerance);
    const double most = error(*run);
    INFO(tolerance << " " << most);
    CHECK(most < 100 * tolerance);
    REQUIRE(run->events().size() == 1);
    CHECK(run->events()[0].kind == ContactEvent::Kind::stop);
    CHECK(std::abs(run->events()[0].time - stop) < 100 * tolerance);
  }
  double last = 0;
  for (const double step : {1e-3, 2.5e-4, 6.25e-5}) {
    const double most = error(*engine_of(scene, EngineKind::stepping, step));
    INFO(step << " " << most);
    CHECK(most < 2 * step);
    if (last > 0) CHECK(last / most > 2.5);
    last = most;
  }
}

TEST_CASE("a pulley that turns: the rope slips against its rim, or drives it as a belt") {
  const std::string pulley = pulley_at(0);
  const double held = kFall * (kHeavy - kLight) / (kHeavy + kLight + kInertia / kRadius / kRadius);
  const double ratio = kHeavy * (kFall - held) / (kLight * (kFall + held));
  for (const double mu : {0.8 * std::log(ratio) / M_PI, 1.2 * std::log(ratio) / M_PI}) {
    const bool slips = factor(mu) < ratio;
    const double a = slips ? slipping(factor(mu)) : held;
    const double first = kHeavy * (kFall - a), second = kLight * (kFall + a);
    const double turns = (first - second) * kRadius / kInertia;
    CHECK((slips ? turns * kRadius < a : std::abs(turns * kRadius - a) < 1e-12));
    for (const EngineKind kind : kBoth) {
      const auto run = engine_of(scene_of(atwood(mu, first + second, 0, pulley.c_str(), "pulley")),
                                 kind, accuracy(kind));
      run->advance(0.8);
      INFO(run->name() << " " << mu);
      CHECK(std::abs(fall(*run) - 0.8 * a) < 1e-6);
      CHECK(std::abs(run->bodies()[2].angular_velocity.y() + 0.8 * turns) < 1e-5);
      CHECK(std::abs(rope(*run).tension - first) < 1e-4);
      CHECK(std::abs(rope(*run).tension_second - second) < 1e-4);
      CHECK(std::abs(run->bodies()[2].position.norm()) < 1e-9);
    }
  }
}

TEST_CASE("a winch hauls a load over a rubbing ring, and around a bollard") {
  constexpr double mu = 0.2, m = 4, speed = 0.3;
  for (const bool bollard : {false, true}) {
    const double wrap = bollard ? 5 * M_PI : 0.5 * M_PI, E = std::exp(mu * wrap);
    const Scene scene = scene_of(
        "[scene]\nend = 2\ngravity = [0, 0, -9.81]\n" + weight("load", m, -3, speed) +
        fmt::format("[[cable]]\nname = \"rope\"\nbodies = [\"world\", \"world\", \"load\"]\n"
                    "at = [[-2, 0, 0], [0, 0, 0], [0, 0, -3]]\nstiffness = 1e4\nlength = {}\n"
                    "winch = {}\ncapstan = {{ friction = {}{} }}\n",
                    5 - 0.5 * (1 + E) * m * kFall / 1e4, -speed, mu,
                    bollard ? ", wrap_deg = 900" : ""));
    for (const EngineKind kind : kBoth) {
      const auto run = engine_of(scene, kind, accuracy(kind));
      run->advance(2);
      INFO(run->name() << " " << bollard);
      CHECK(std::abs(run->bodies()[0].position.z() + 3 - 2 * speed) < 1e-7);
      CHECK(std::abs(rope(*run).tension - E * m * kFall) < 1e-4);
      CHECK(std::abs(rope(*run).tension_second - m * kFall) < 1e-4);
    }
  }
}

TEST_CASE("a rope that rubs loses energy, and a slack one nothing") {
  const double E = factor(0.1), a = slipping(E);
  const auto run = engine_of(scene_of(atwood(0.1, tensions(E))), EngineKind::event, 1e-9);
  const auto energy = [&] {
    return run->diagnostics().kinetic_energy + run->diagnostics().potential_energy;
  };
  const double before = energy();
  run->advance(0.5);
  const double heat = (kHeavy * (kFall - a) - kLight * (kFall + a)) * 0.5 * a * 0.25;
  CHECK(std::abs(energy() - before + heat) < 1e-7);
  // Shorter by its stretch and .1 m: both fall freely.
  for (const EngineKind kind : kBoth) {
    const auto slack = engine_of(scene_of(atwood(0.1, -1000)), kind, accuracy(kind));
    slack->advance(0.1);
    CHECK(std::abs(fall(*slack) - 0.1 * kFall) < 1e-9);
    CHECK(rope(*slack).tension == 0);
    CHECK(rope(*slack).tension_second == 0);
  }
}

/// The same over two drums, half a turn in all.
std::string on_two_drums(const std::string& capstans, double tensions, double speed = 0,
                         const char* more = "", const char* second = "world") {
  return "[scene]\nend = 2\ngravity = [0, 0, -9.81]\n[output]\nforces = true\n" +
         weight("heavy", kHeavy, -2, -speed) + weight("light", kLight, -5, speed, 1) + more +
         fmt::format(
             "[[cable]]\nname = \"rope\"\nbodies = [\"heavy\", \"world\", \"{}\", \"light\"]\n"
             "at = [[0, 0, -2], [0, 0, 0], [1, 0, 0], [1, 0, -5]]\nstiffness = {}\nlength = {}\n"
             "capstan = [{}]\n",
             second, kStiffness, 8 - 0.5 * tensions / kStiffness, capstans);
}
std::string two_drums(double first, double second) {
  return fmt::format("{{ ring = 1, friction = {} }}, {{ ring = 2, friction = {} }}", first, second);
}

TEST_CASE("a rope over two drums slips with tensions of the ratio of the sum of both wraps") {
  for (const auto& [first, second] : {std::pair(0.05, 0.15), std::pair(0.2, 0.0)}) {
    const double E = std::exp(0.5 * M_PI * (first + second)), a = slipping(E);
    const Scene scene = scene_of(on_two_drums(two_drums(first, second), tensions(E)));
    for (const EngineKind kind : kBoth) {
      const auto run = engine_of(scene, kind, accuracy(kind));
      run->advance(0.8);
      INFO(run->name() << " " << first);
      CHECK(std::abs(fall(*run) - 0.8 * a) < 1e-7);
      CHECK(std::abs(run->bodies()[1].velocity.z() - 0.8 * a) < 1e-7);
      CHECK(std::abs(rope(*run).tension / rope(*run).tension_second - E) < 1e-8);
      CHECK(std::abs(rope(*run).tension - kHeavy * (kFall - a)) < 1e-5);
    }
  }
}

TEST_CASE("a rope over two drums holds as long as e^(mu times the sum of its wraps) is enough") {
  const double least = std::log(kHeavy / kLight) / M_PI;
  for (const EngineKind kind : kBoth)
    for (const double part : {0.5, 1.0}) {
      const double first = 1.001 * least * part, second = 2 * 1.001 * least - first;
      const auto run =
          engine_of(scene_of(on_two_drums(two_drums(first, second), (kHeavy + kLight) * kFall)),
                    kind, accuracy(kind));
      run->advance(1);
      INFO(run->name() << " " << part);
      CHECK(std::abs(down(*run)) < 1e-9);
      CHECK(std::abs(rope(*run).tension - kHeavy * kFall) < 1e-6);
      CHECK(std::abs(rope(*run).tension_second - kLight * kFall) < 1e-6);
    }
}

TEST_CASE("a rope comes to rest on two drums, and holds there") {
  const double E = factor(0.3), a = slipping(E), speed = 0.5, stop = -speed / a;
  const Scene scene = scene_of(on_two_drums(two_drums(0.4, 0.2), tensions(E), speed));
  for (const EngineKind kind : kBoth) {
    const auto run = engine_of(scene, kind, accuracy(kind));
    run->advance(0.5 * stop);
    CHECK(std::abs(fall(*run) - 0.5 * speed) < (kind == EngineKind::event ? 1e-8 : 5e-3));
    run->advance(stop + 0.3);
    INFO(run->name() << " " << down(*run));
    // Half of the weights swings on the rope: mm.
    CHECK(std::abs(down(*run) + 0.5 * speed * speed / a) < 5e-3);
    CHECK(std::abs(fall(*run) - run->bodies()[1].velocity.z()) < 0.1);
    const double ratio = rope(*run).tension / rope(*run).tension_second;
    CHECK(ratio < E);
  }
}

TEST_CASE("a rope slips on one drum and turns the other one, on which it holds") {
  const std::string pulley = pulley_at(1);
  const double E = std::exp(0.5 * M_PI * 0.1), inert = kInertia / kRadius / kRadius;
  const double a = kFall * (kHeavy / E - kLight) / (kHeavy / E + kLight + inert);
  const double first = kHeavy * (kFall - a), middle = first / E, second = kLight * (kFall + a);
  const double least = std::log(middle / second) / (0.5 * M_PI);
  for (const double mu : {1.05 * least, 0.6 * least}) {
    const bool holds = mu > least;
    // A pulley on which the rope slips is slower than the rope.
    const double both = E * std::exp(0.5 * M_PI * mu), now = holds ? a : slipping(both);
    const double T_0 = holds ? first : kHeavy * (kFall - now), T_2 = kLight * (kFall + now);
    const double turns = holds ? a / kRadius : (T_0 / E - T_2) * kRadius / kInertia;
    CHECK((holds || turns * kRadius < now));
    const std::string capstans = fmt::format(
        "{{ ring = 2, friction = {}, radius = {}, axis = [0, 1, 0] }}, {{ ring = 1, friction = 0.1 "
        "}}",
        mu, kRadius);
    const Scene scene = scene_of(on_two_drums(capstans, T_0 + T_2, 0, pulley.c_str(), "pulley"));
    for (const EngineKind kind : kBoth) {
      const auto run = engine_of(scene, kind, accuracy(kind));
      run->advance(0.8);
      INFO(run->name() << " " << holds);
      CHECK(std::abs(fall(*run) - 0.8 * now) < 1e-6);
      CHECK(std::abs(std::abs(run->bodies()[2].angular_velocity.y()) - 0.8 * turns) < 1e-5);
      CHECK(std::abs(rope(*run).tension - T_0) < 1e-4);
      CHECK(std::abs(rope(*run).tension_second - T_2) < 1e-4);
    }
  }
}

TEST_CASE("capstans are written, read again, planned, and refused by name") {
  Scene scene = scene_of(atwood(0.3, 10));
  scene.springs[0].cable->capstans[0].wrap = 7.5;
  const Scene again = parse_scene(write_scene(scene), "again");
  CHECK(write_scene(again) == write_scene(scene));
  REQUIRE(again.springs[0].cable->capstans.size() == 1);
  CHECK(again.springs[0].cable->capstans[0].friction == 0.3);
  CHECK(again.springs[0].cable->capstans[0].wrap == 7.5);
  const Plan plan = make_plan(scene);
  CHECK(plan.engine == EngineKind::stepping);
  bool planned = false;
  for (const Effect& each : plan.effects)
    planned = planned || (each.name == "capstan friction" && each.detail == "1 cable");
  CHECK(planned);
  CHECK(thrown<std::invalid_argument>([&] {
          engine_of(scene, EngineKind::smooth, 1e-6);
        }).find("smooth") != std::string::npos);
  const Scene two =
      scene_of(on_two_drums("{ ring = 2, friction = 0.1 }, { ring = 1, friction = 0.2 }", 9));
  REQUIRE(two.springs[0].cable->capstans.size() == 2);
  CHECK(two.springs[0].cable->capstans[0].friction == 0.2);
  CHECK(write_scene(parse_scene(write_scene(two), "again")) == write_scene(two));
  CHECK(why_not(on_two_drums(two_drums(0.1, 0.2), 9)).empty());
  CHECK(why_not(on_two_drums("{ ring = 1, friction = 0.1 }, { ring = 1, friction = 0.2 }", 9))
            .find("ring 1 is there twice") != std::string::npos);
  const std::string good = atwood(0.3, 10);
  const auto refused = [&](const std::string& from, const std::string& to, const char* field) {
    std::string text = good;
    const std::size_t place = text.find(from);
    REQUIRE(place != std::string::npos);
    text.replace(place, from.size(), to);
    const std::string message = why_not(text);
    INFO(to << ": " << message);
    CHECK(message.find("cable \"rope\"") != std::string::npos);
    CHECK(message.find(field) != std::string::npos);
  };
  CHECK(why_not(good).empty());
  refused("friction = 0.3", "wrap_deg = 3", "friction");
  refused("friction = 0.3", "friction = -1", "friction");
  refused("friction = 0.3", "friction = 0.3, wrap_rad = -1", "wrap_rad");
  refused("friction = 0.3", "friction = 0.3, ring = 2", "ring");
  refused("friction = 0.3", "friction = 0.3, radius = 0.1", "axis");
  refused("friction = 0.3", "friction = 0.3, radius = 0.1, axis = [0, 1, 0]", "radius");
  refused("friction = 0.3", "friction = 0.3, turns = 2", "turns");
  refused("\"world\", \"light\"]\nat = [[0, 0, -2], [0, 0, 0],", "\"light\"]\nat = [[0, 0, -2],",
          "ring");
}

}  // namespace capstan
