// Runs of the event engine for tests. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdio>
#include <memory>
#include <sstream>
#include <string>
#include <tether/scene/engine.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <vector>

#include "support/catch.hpp"

namespace event_runs {

using namespace tether::scene;
using Eigen::Vector3d;
using Kind = ContactEvent::Kind;

inline const std::vector<double> kLadder = {1e-4, 1e-6, 1e-8, 1e-10};

inline std::string number(double x) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}

/// The scene of a text with the event engine at a tolerance, moved to its end.
inline std::unique_ptr<Engine> run(const std::string& text, double tolerance, double end,
                                   const std::string& gravity = "[0, 0, -9.81]") {
  const Scene scene = parse_scene("[scene]\nengine = \"event\"\nend = " + number(end) + "\n" +
                                      (gravity.empty() ? "" : "gravity = " + gravity + "\n") +
                                      "[event]\ntolerance = " + number(tolerance) + "\n" + text,
                                  "test");
  REQUIRE(make_plan(scene).engine == EngineKind::event);
  auto engine = make_engine(scene);
  engine->advance(end);
  return engine;
}

inline std::vector<ContactEvent> of_kind(const Engine& engine, Kind kind) {
  std::vector<ContactEvent> out;
  for (const ContactEvent& each : engine.events())
    if (each.kind == kind) out.push_back(each);
  return out;
}

/// A state saved at `cut` and restored moves to `end` with the bits of the engine that saved it,
/// and tells no event twice.
inline void goes_on_with_its_bits(const Scene& scene, double cut, double end) {
  CAPTURE(cut);
  const auto first = make_engine(scene), second = make_engine(scene);
  first->advance(cut);
  std::stringstream state;
  first->save(state);
  second->restore(state);
  CHECK(second->time() == first->time());
  first->advance(end);
  second->advance(end);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyState &p = first->bodies()[b], &q = second->bodies()[b];
    CHECK(q.position == p.position);
    CHECK(q.velocity == p.velocity);
    CHECK(q.orientation.coeffs() == p.orientation.coeffs());
    CHECK(q.angular_velocity == p.angular_velocity);
  }
  REQUIRE(second->events().size() <= first->events().size());
  const std::size_t before = first->events().size() - second->events().size();
  for (std::size_t k = 0; k < second->events().size(); ++k)
    CHECK(second->events()[k].time == first->events()[before + k].time);
}

/// Energy that is left, with what impacts took, less that of the start, where friction does no
/// work.
inline double ledger(const Engine& engine, double start) {
  double sum = engine.diagnostics().kinetic_energy + engine.diagnostics().potential_energy - start;
  for (const ContactEvent& each : engine.events()) sum += each.lost;
  return sum;
}

const std::string kFloor = R"(
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "floor"
)";

inline std::string pair(const std::string& values) {
  return "[[pair]]\nbetween = [\"floor\", \"body\"]\n" + values + "\n";
}

/// Above the floor.
inline std::string ball(double height, double restitution) {
  return kFloor + R"(
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 2
material = "body"
position = [0, 0, )" +
         number(height + 0.1) + "]\n" + pair("restitution = " + number(restitution));
}

}  // namespace event_runs
