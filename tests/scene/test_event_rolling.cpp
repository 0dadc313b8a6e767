// Rolling and torsional friction in the event engine. SPDX-License-Identifier: BSD-3-Clause
#include "event_runs.hpp"

using namespace event_runs;

namespace {

constexpr double kG = 9.81, kRadius = 0.15, kMass = 1.7;
constexpr double kShape = 0.45;  // of I = kShape m r^2

/// On the floor, at rest but for what `values` say.
std::string roller(const std::string& values, const std::string& law) {
  const std::string inertia = number(kShape * kMass * kRadius * kRadius);
  return kFloor + "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = " + number(kRadius) +
         "\nmass = " + number(kMass) + "\ninertia = [" + inertia + ", " + inertia + ", " + inertia +
         "]\nmaterial = \"body\"\nposition = [0, 0, " + number(kRadius) + "]\n" + values +
         pair("friction = 0.6\n" + law);
}
std::string rolls(double speed, double spin = 0) {
  return "velocity = [" + number(speed) + ", 0, 0]\nangular_velocity = [0, " +
         number(speed / kRadius) + ", " + number(spin) + "]\n";
}
std::string down(double slope) {
  return "[" + number(kG * std::sin(slope)) + ", 0, " + number(-kG * std::cos(slope)) + "]";
}
/// c = 0: without rolling friction.
double acceleration(double slope, double c) {
  return kG * (std::sin(slope) - c / kRadius * std::cos(slope)) / (1 + kShape);
}
const BodyState& ball_of(const Engine& engine) { return engine.bodies()[1]; }

/// Energy that the moments took, by the ledger: that of the start less that of now.
double taken(const Engine& engine, double start) {
  return start - engine.diagnostics().kinetic_energy - engine.diagnostics().potential_energy;
}

/// Four wheels on hinges under a cart that moves up a slope, in x.
std::string cart(double speed, double c, bool copies) {
  std::string text = kFloor + "[[body]]\nname = \"cart\"\nmass = 8\ninertia = [1, 1.2, 1.5]\n" +
                     "position = [0, 0, " + number(kRadius) + "]\nvelocity = [" + number(speed) +
                     ", 0, 0]\n";
  for (int k = 0; k < 4; ++k) {
    const std::string name = "wheel " + std::to_string(k);
    const std::string at = "[" + number(k < 2 ? 0.5 : -0.5) + ", " + number(k % 2 ? 0.4 : -0.4) +
                           ", " + number(kRadius) + "]";
    text += "[[body]]\nname = \"" + name + "\"\nshape = \"sphere\"\nradius = " + number(kRadius) +
            "\nmass = 1\ninertia = [0.01, 0.012, 0.01]\nmaterial = \"body\"\n" +
            "position = " + at + "\n" + rolls(speed);
    for (int copy = 0; copy < (copies ? 3 : 1); ++copy)
      text += "[[joint]]\nkind = \"hinge\"\nbodies = [\"" + name + "\", \"cart\"]\nat = " + at +
              "\naxis = [0, 1, 0]\n";
  }
  return text + pair("friction = 0.8\nrolling = " + number(c)) +
         "[[pair]]\nbetween = [\"body\", \"body\"]\n";
}

}  // namespace

TEST_CASE("events: rolling friction stops a ball after v^2 / 2a, a = c g / (r (1 + k))") {
  const double c = 0.004, v = 1.3, a = -acceleration(0, c), stop = v / a;
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(roller(rolls(v), "rolling = " + number(c)), tolerance, 1.1 * stop);
    const auto stops = of_kind(*engine, Kind::roll_stop);
    REQUIRE(stops.size() == 1);
    CHECK(stops[0].first + stops[0].second == 1);  // the ball and the floor
    CHECK(std::abs(stops[0].time - stop) < 10 * tolerance);
    CHECK(std::abs(ball_of(*engine).position.x() - v * v / (2 * a)) < 10 * tolerance);
    CHECK(ball_of(*engine).velocity.norm() < 10 * tolerance);
    CHECK(engine->counts().steps < 2000);
  }
}

TEST_CASE("events: a ball that slides, rolls, and stops, and one that spins as well") {
  const double c = 0.006, mu = 0.6, v = 2;
  // Friction turns it against the moment until it rolls.
  const double turns = (mu * kRadius - c) * kG / (kShape * kRadius * kRadius);
  const double grips = v / (mu * kG + kRadius * turns), then = v - mu * kG * grips;
  const double a = -acceleration(0, c), stop = grips + then / a;
  const double way = v * grips - mu * kG * grips * grips / 2 + then * then / (2 * a);
  const double d = 0.002, w = 9, spun = kShape * kRadius * kRadius * w / (d * kG);
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto slides =
        run(roller("velocity = [2, 0, 0]\n", "rolling = " + number(c)), tolerance, 1.05 * stop);
    REQUIRE(of_kind(*slides, Kind::stop).size() == 1);
    CHECK(std::abs(of_kind(*slides, Kind::stop)[0].time - grips) < 10 * tolerance);
    CHECK(std::abs(of_kind(*slides, Kind::roll_stop).back().time - stop) < 10 * tolerance);
    CHECK(std::abs(ball_of(*slides).position.x() - way) < 10 * tolerance);
    const auto spins =
        run(roller(rolls(v, w), "rolling = " + number(c) + "\ntorsional = " + number(d)), tolerance,
            1.2 * std::max(spun, v / a));
    const auto stops = of_kind(*spins, Kind::roll_stop);
    REQUIRE(stops.size() == 2);
    CHECK(std::abs(stops[0].time - std::min(spun, v / a)) < 10 * tolerance);
    CHECK(std::abs(stops[1].time - std::max(spun, v / a)) < 10 * tolerance);
    CHECK(std::abs(ball_of(*spins).position.x() - v * v / (2 * a)) < 10 * tolerance);
    CHECK(ball_of(*spins).angular_velocity.norm() < 10 * tolerance);
  }
}

TEST_CASE("events: a ball stands on a slope below c/r, rolls above it, and its moment is told") {
  const double slope = 0.1, least = kRadius * std::tan(slope);
  for (const double part : {0.5, 0.999, 1.001}) {
    const double c = part * least, a = part < 1 ? acceleration(slope, c) : 0;
    for (const double tolerance : {1e-4, 1e-7, 1e-10}) {
      CAPTURE(part, tolerance);
      const auto engine = run(roller("", "rolling = " + number(c)), tolerance, 1, down(slope));
      CHECK(std::abs(ball_of(*engine).position.x() - a / 2) < 10 * tolerance);
      CHECK(std::abs(ball_of(*engine).velocity.x() - a) < 10 * tolerance);
      REQUIRE(engine->contacts().size() == 1);
      const double bound = std::min(c, least) * kMass * kG * std::cos(slope);
      CHECK(std::abs(engine->contacts()[0].moment.norm() - bound) < 1e-4 * bound);
    }
  }
}

TEST_CASE("events: what rolls up a slope stops and rolls down again, and the ledger closes") {
  const double slope = 0.2, c = 0.4 * kRadius * std::tan(slope), v = 1.5;
  const double up = 2 * acceleration(slope, 0) - acceleration(slope, c);
  const double turn = v / up, end = 2 * turn, a = acceleration(slope, c);
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const std::string text = roller(rolls(-v), "rolling = " + number(c));
    const auto engine = run(text, tolerance, end, down(slope));
    const double back = a * turn * turn / 2, top = -v * v / (2 * up);
    CHECK(std::abs(ball_of(*engine).position.x() - top - back) < 10 * tolerance);
    CHECK(of_kind(*engine, Kind::roll_stop).size() == 1);
    // c m g cos times the angle that it turned by.
    const double work = c * kMass * kG * std::cos(slope) * (back - top) / kRadius;
    const double start =
        0.5 * kMass * v * v * (1 + kShape) + kMass * kG * std::cos(slope) * kRadius;
    CHECK(std::abs(taken(*engine, start) - work) < 10 * tolerance * kMass * kG);
  }
}

TEST_CASE("events: rolling friction stops a cart on hinged wheels, with copies of hinges, too") {
  const double slope = 0.12, c = 1.6 * kRadius * std::tan(slope), v = 1.4;
  const double moved = 12 + 4 * 0.012 / (kRadius * kRadius);
  const double a = 12 * kG * (std::sin(slope) + c / kRadius * std::cos(slope)) / moved;
  for (const bool copies : {false, true})
    for (const double tolerance : {1e-4, 1e-7, 1e-10}) {
      CAPTURE(copies, tolerance);
      const auto engine = run(cart(-v, c, copies), tolerance, 1.3 * v / a, down(slope));
      CHECK(std::abs(engine->bodies()[1].position.x() + v * v / (2 * a)) < 10 * tolerance);
      CHECK(engine->bodies()[1].velocity.norm() < 10 * tolerance);
      REQUIRE(!of_kind(*engine, Kind::roll_stop).empty());
      CHECK(std::abs(of_kind(*engine, Kind::roll_stop)[0].time - v / a) < 10 * tolerance);
    }
}

TEST_CASE("events: an impact has its moment of rolling friction") {
  // Sliding still afterwards: spin less (1 + e) v_n (mu r + c) / (k r^2) in all.
  const double h = 0.3, e = 0.4, c = 0.01, w = 90, falls = std::sqrt(2 * kG * h);
  const double after = w - (1 + e) * falls * (0.6 * kRadius + c) / (kShape * kRadius * kRadius);
  REQUIRE(after * kRadius > 0.6 * (1 + e) * falls);
  for (const double tolerance : kLadder) {
    std::string text =
        roller("angular_velocity = [0, 90, 0]\n", "restitution = 0.4\nrolling = " + number(c));
    text.replace(text.find("position = [0, 0, " + number(kRadius)), 18 + number(kRadius).size(),
                 "position = [0, 0, " + number(kRadius + h));
    const auto engine = run(text, tolerance, falls / kG * (1 + 1.5 * e));
    REQUIRE(engine->events().size() == 1);
    CHECK(std::abs(ball_of(*engine).angular_velocity.y() - after) < 10 * tolerance * w);
    CHECK(std::abs(ball_of(*engine).velocity.x() - 0.6 * (1 + e) * falls) < 10 * tolerance);
  }
}

TEST_CASE("events: rolling friction goes on with its bits after a restart") {
  const Scene scene =
      parse_scene("[scene]\nengine = \"event\"\nend = 3\ngravity = [0, 0, -9.81]\n[event]\n" +
                      roller("velocity = [0.8, 0, 0]\nangular_velocity = [1, 0, 9]\n",
                             "rolling = 0.01\ntorsional = 0.002"),
                  "test");
  for (const double cut : {0.02, 0.3, 0.9, 2.5}) goes_on_with_its_bits(scene, cut, 3);
}
