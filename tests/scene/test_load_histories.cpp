// Loads that change with time, in all engines. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>

#include "event_runs.hpp"

using namespace event_runs;

namespace {

const std::string kPoint =
    "[[body]]\nname = \"body\"\nmaterial = \"body\"\nshape = \"points\"\npoints = [[0, 0, 0]]\n"
    "mass = 2\ninertia = [1, 2, 3]\n";

std::string load(const std::string& more) { return "[[load]]\nbody = \"body\"\n" + more + "\n"; }

std::unique_ptr<Engine> moved(const std::string& options, const std::string& text, double end) {
  auto engine = make_engine(
      parse_scene("[scene]\nend = " + number(end) + "\n" + options + "\n" + text, "test"));
  engine->advance(end);
  return engine;
}

const std::string kEvent = "[event]\ntolerance = 1e-9", kSmooth = "[smooth]\ntolerance = 1e-9",
                  kSteps = "[stepping]\nstep = 1e-3",
                  kParts = "[stepping]\nstep = 0.02\naccuracy = 1e-5";

}  // namespace

TEST_CASE("loads: a sine and a table push a body as their integrals say, in every engine") {
  // m v = F (mean t + (cos p - cos(w t + p)) / w); the table's pulse of 0.01 s ends with a jump.
  const double end = 2.5, w = 2 * M_PI * 0.7, phase = 0.4;
  const double sine = 6 * (0.3 * end + (std::cos(phase) - std::cos(w * end + phase)) / w) / 2;
  const double table = 6 * (0.5 * (0.1 + 0.2) + 0.01 * 50) / 2;
  for (const std::string& options : {kEvent, kSmooth, kSteps, kParts}) {
    CAPTURE(options);
    const auto a = moved(options,
                         kPoint + load("force = [0, 6, 0]\nsine = { mean = 0.3, frequency = 0.7, "
                                       "phase_rad = 0.4 }"),
                         end);
    CHECK(std::abs(a->bodies()[0].velocity.y() - sine) < 1e-7);
    const auto b = moved(options,
                         kPoint + load("force = [6, 0, 0]\ntable = [[0, 0], [0.1, 1], [0.3, 0], "
                                       "[1.0003, 0], [1.0003, 50], [1.0103, 50], [1.0103, 0]]"),
                         end);
    CHECK(std::abs(b->bodies()[0].velocity.x() - table) < 1e-7);
  }
}

TEST_CASE("loads: work of a torque that changes is all the energy there is") {
  const double w = 2 * M_PI, turn = 4 * (1 - std::cos(w * 0.3)) / w / 3;
  for (const std::string& options : {kEvent, kSmooth}) {
    CAPTURE(options);
    const auto engine =
        moved(options, kPoint + load("torque = [0, 0, 4]\nsine = { frequency = 1 }"), 0.3);
    CHECK(std::abs(engine->bodies()[0].angular_velocity.z() - turn) < 1e-8);
    CHECK(std::abs(engine->diagnostics().kinetic_energy - 1.5 * turn * turn) < 1e-8);
  }
}

TEST_CASE("event: a load that grows moves a block when it passes friction, and a jump at once") {
  // F = 10 t against mu m g = 0.4 2 9.81 N; from 1 s on 0.
  const double slips = 0.4 * 9.81 * 2 / 10;
  const std::string text = kFloor + kPoint +
                           load("force = [10, 0, 0]\ntable = [[0, 0], [1, 1], [1, 0]]") +
                           pair("friction = 0.4");
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 1.5);
    const auto begin = of_kind(*engine, Kind::slip), end = of_kind(*engine, Kind::stop);
    REQUIRE(begin.size() == 1);
    REQUIRE(end.size() == 1);
    CHECK(std::abs(begin[0].time - slips) < 10 * tolerance);
    const double speed = 2.5 * (1 - slips * slips) - 0.4 * 9.81 * (1 - slips);
    CHECK(std::abs(end[0].time - (1 + speed / (0.4 * 9.81))) < 10 * tolerance);
  }
  // Stuck until it jumps beyond the cone.
  const auto jumps =
      run(kFloor + kPoint + load("force = [10, 0, 0]\ntable = [[0.5, 0.1], [0.5, 2]]") +
              pair("friction = 0.4"),
          1e-8, 1);
  REQUIRE(of_kind(*jumps, Kind::slip).size() == 1);
  CHECK(std::abs(of_kind(*jumps, Kind::slip)[0].time - 0.5) < 1e-7);
  CHECK(std::abs(jumps->bodies()[1].velocity.x() - (10 - 0.4 * 9.81) * 0.5) < 1e-7);
}

TEST_CASE("loads: runs that change at kinks go on with their bits") {
  const std::string text = kFloor +
                           "[[body]]\nname = \"body\"\nmaterial = \"body\"\nshape = \"box\"\nsize "
                           "= [0.2, 0.2, 0.2]\nmass = 2\nposition = [0, 0, 0.1]\n" +
                           load("force = [10, 0, 0]\ntable = [[0, 0], [0.3, 1], [0.7, 0.1]]") +
                           pair("friction = 0.1");
  for (const std::string& options : {kEvent, kSteps})
    for (const double cut : {0.3, 0.31, 0.7})
      goes_on_with_its_bits(
          parse_scene("[scene]\nend = 1\ngravity = [0, 0, -9.81]\n" + options + "\n" + text,
                      "test"),
          cut, 1);
}

TEST_CASE("loads: histories are read, written again and refused by name") {
  const std::string begin = "[scene]\nend = 1\n" + kPoint;
  const Scene scene = parse_scene(
      begin + load("force = [1, 0, 0]\ntable = [[0, 1], [2, -3]]") +
          load("torque = [1, 0, 0]\nsine = { mean = 0.5, frequency = 2, phase_deg = 90 }"),
      "loads.toml");
  const Scene again = parse_scene(write_scene(scene), "again.toml");
  REQUIRE(again.loads.size() == 2);
  REQUIRE(again.loads[0].history);
  REQUIRE(again.loads[0].history->table.size() == 2);
  CHECK(again.loads[0].history->table[1].time == 2);
  CHECK(again.loads[0].history->table[1].factor == -3);
  CHECK(again.loads[1].history->mean == 0.5);
  CHECK(again.loads[1].history->frequency == 2);
  CHECK(again.loads[1].history->phase == M_PI / 2);
  const auto refused = [&](const std::string& more, const std::string& word) {
    CHECK_THROWS_WITH(parse_scene(begin + load("force = [1, 0, 0]\n" + more), "loads.toml"),
                      Catch::Contains(word));
  };
  refused("table = [[1, 1], [0.5, 1]]", "table");
  refused("table = []", "table");
  refused("table = [[0, 1, 2]]", "table");
  refused("table = [[0, inf]]", "table");
  refused("table = 3", "table");
  refused("sine = { frequency = -1 }", "frequency");
  refused("sine = { rate = 1 }", "rate");
  refused("sine = { frequency = 1 }\ntable = [[0, 1]]", "not both");
}

TEST_CASE("loads and motions: a frequency whose phases are lost in rounding is refused by name") {
  const std::string driven =
      kPoint + "[[joint]]\nkind = \"slider\"\nbodies = [\"body\", \"world\"]\naxis = [1, 0, 0]\n";
  const auto sine = [](const std::string& f) {
    return load("force = [1, 0, 0]\nsine = { frequency = " + f + " }");
  };
  for (const char* frequency : {"1e300", "1e15", "2.1e13"}) {
    CAPTURE(frequency);
    const std::string motion =
        driven + "motion = { amplitude = 1, frequency = " + std::string(frequency) + " }\n";
    const std::vector<std::string> scenes = {kPoint + sine(frequency), motion};
    for (const std::string& text : scenes)
      CHECK_THROWS_WITH(parse_scene("[scene]\nend = 5\n" + text, "loads.toml"),
                        Catch::Contains("frequency = ") && Catch::Contains("2e+13 Hz"));
  }
  // Also where the end comes later, and in scenes that no file has checked.
  const auto scene = [&](const std::string& engine, const std::string& frequency) {
    return parse_scene("[scene]\nend = 1\nengine = \"" + engine + "\"\n" + kPoint + sine(frequency),
                       "loads.toml");
  };
  Scene steps = scene("stepping", "1e13");
  CHECK(std::string(make_engine(steps)->name()) == "stepping");
  steps.end = 11;
  CHECK_THROWS_WITH(make_engine(steps), Catch::Contains("frequency of a load"));
  for (const char* engine : {"smooth", "event", "automatic"}) {
    CAPTURE(engine);
    Scene resolved = scene(engine, "1e7");
    CHECK(make_plan(resolved).engine != EngineKind::stepping);
    resolved.end = 20;
    CHECK_THROWS_WITH(make_plan(resolved), Catch::Contains("use [stepping], which takes means"));
  }
}

TEST_CASE("loads: a fast sine is not taken for a constant force") {
  // v = (1 - cos w t) / (m w): less than 8e-6 m/s; 0.03 m/s came of it at steps of many periods.
  for (const std::string& options : {kEvent, kSmooth}) {
    const auto engine =
        moved(options, kPoint + load("force = [1, 0, 0]\nsine = { frequency = 2e4 }"), 0.02003);
    const double w = 2 * M_PI * 2e4, v = (1 - std::cos(w * 0.02003)) / (2 * w);
    CHECK(std::abs(engine->bodies()[0].velocity.x() - v) < 1e-7);
  }
}
