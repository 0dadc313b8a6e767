// Friction that depends on the direction. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cmath>
#include <sstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "engines_of_texts.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr EngineKind kBoth[] = {EngineKind::event, EngineKind::stepping};

std::string text_of(const Vector3d& v) { return fmt::format("[{}, {}, {}]", v.x(), v.y(), v.z()); }

// A block on a plane, whose axis is x.
std::string block(double along, double across, const Vector3d& gravity,
                  const Vector3d& velocity = Vector3d::Zero()) {
  return fmt::format(R"(
[scene]
end = 1
gravity = {}
[[body]]
name = "floor"
fixed = true
shape = "plane"
material = "snow"
[[body]]
name = "block"
shape = "box"
size = [0.6, 0.4, 0.1]
mass = 2
position = [0, 0, 0.05]
velocity = {}
material = "ski"
friction_axis = [3, 0, 0]
[[pair]]
between = ["ski", "snow"]
friction = {}
friction_across = {}
)",
                     text_of(gravity), text_of(velocity), along, across);
}

constexpr double kAlong = 0.1, kAcross = 0.4;

// M^2 e / |M e|, M = diag(kAlong, kAcross): friction over the normal force against a slip along e.
Vector2d resistance(const Vector2d& e) {
  const Vector2d m(kAlong, kAcross);
  return m.cwiseProduct(m).cwiseProduct(e) / m.cwiseProduct(e).norm();
}

// A skate on an incline: free along its blade, held across it; it turns about the normal.
std::string skate(double across) {
  return fmt::format(R"(
[scene]
end = 2
gravity = [1.5, 0, -9]
[[body]]
name = "ice"
fixed = true
shape = "plane"
material = "ice"
[[body]]
name = "skate"
shape = "points"
points = [[0, 0, 0], [0, 0, 1]]
mass = 2
inertia = [0.1, 0.1, 0.1]
angular_velocity = [0, 0, 3]
material = "skate"
friction_axis = [1, 0, 0]
[[pair]]
between = ["skate", "ice"]
friction = 0
friction_across = {}
)",
                     across);
}

}  // namespace

TEST_CASE(
    "a block slides down an incline between the slope and its axis, by the ellipse's normal") {
  const double steep = 9.81 * std::sin(0.6), press = 9.81 * std::cos(0.6);
  for (const double turn : {0.2, 0.6, 1.2}) {
    const Vector2d e(std::cos(turn), std::sin(turn)), q = press * resistance(e);
    const double b = e.dot(q),
                 acceleration = -b + std::sqrt(b * b - q.squaredNorm() + steep * steep);
    const Vector2d slope = acceleration * e + q;  // gravity in the plane
    const Scene scene = scene_of(block(kAlong, kAcross, Vector3d(slope.x(), slope.y(), -press)));
    for (const EngineKind kind : kBoth) {
      const bool events = kind == EngineKind::event;
      const auto engine = engine_of(scene, kind, events ? 1e-8 : 1e-3);
      engine->advance(1);
      const BodyState& now = engine->bodies()[1];
      CHECK((now.velocity.head<2>() - acceleration * e).norm() < 1e-6);
      CHECK((now.position.head<2>() - 0.5 * acceleration * e).norm() <
            (events ? 1e-7 : 0.6 * acceleration * 1e-3));
      CHECK(now.angular_velocity.norm() < 1e-6);
      const Vector3d force = total_forces(*engine).contact[1];
      CHECK((force.head<2>() + 2 * q).norm() < 1e-5);
    }
  }
}

TEST_CASE("the slip of a block that friction slows keeps its invariant") {
  // v_1' / v_1 : v_2' / v_2 = mu_1^2 : mu_2^2
  const Vector3d start(2, 1.5, 0);
  const Scene scene = scene_of(block(0.2, 0.3, Vector3d(0, 0, -9.81), start));
  const auto invariant = [&](const Vector3d& v) {
    return v.y() / start.y() - std::pow(v.x() / start.x(), 2.25);
  };
  const auto events = engine_of(scene, EngineKind::event, 1e-9);
  for (const double t : {0.2, 0.4, 0.6}) {
    events->advance(t);
    CHECK(std::abs(invariant(events->bodies()[1].velocity)) < 1e-7);
    CHECK(events->bodies()[1].velocity.x() > 0.1);
  }
  double before = 0;
  for (const double step : {4e-3, 2e-3, 1e-3}) {
    const auto steps = engine_of(scene, EngineKind::stepping, step);
    steps->advance(0.6);
    const double error = std::abs(invariant(steps->bodies()[1].velocity));
    CHECK(error < 2 * step);
    if (before > 0) CHECK(error < 0.6 * before);
    before = error;
  }
}

TEST_CASE("a skate that turns on an incline drifts across it along a cycloid") {
  // u = (g / w) sin(w t) along the blade; g in the plane.
  const double g = 1.5, w = 3, t = 2;
  const Vector2d place =
      g / (w * w) *
      Vector2d(0.5 * std::pow(std::sin(w * t), 2), 0.5 * w * t - 0.25 * std::sin(2 * w * t));
  const double speed = g / w * std::sin(w * t);
  for (const EngineKind kind : kBoth) {
    const bool events = kind == EngineKind::event;
    const auto engine = engine_of(scene_of(skate(0.8)), kind, events ? 1e-9 : 5e-4);
    engine->advance(t);
    const BodyState& now = engine->bodies()[1];
    CHECK((now.position.head<2>() - place).norm() < (events ? 1e-7 : 2e-3));
    CHECK((now.velocity.head<2>() - speed * Vector2d(std::cos(w * t), std::sin(w * t))).norm() <
          (events ? 1e-7 : 3e-3));
    // The edge holds m (u w + g sin(w t)) = 2 m g sin(w t).
    if (events)
      CHECK(total_forces(*engine).contact[1].head<2>().norm() ==
            Approx(2 * 2 * g * std::abs(std::sin(w * t))).epsilon(1e-6));
  }
}

TEST_CASE("a load within the ellipse holds, one beyond it moves the block") {
  const double weight = 2 * 9.81;
  for (const double turn : {0.1, 0.7, 1.4})
    for (const double part : {0.99, 1.01})
      for (const EngineKind kind : kBoth) {
        const Vector2d force =
            part * weight * Vector2d(kAlong * std::cos(turn), kAcross * std::sin(turn));
        const std::string text =
            block(kAlong, kAcross, Vector3d(0, 0, -9.81)) +
            fmt::format("[[load]]\nbody = \"block\"\nforce = [{}, {}, 0]\n", force.x(), force.y());
        const auto engine =
            engine_of(scene_of(text), kind, kind == EngineKind::event ? 1e-8 : 1e-3);
        engine->advance(0.5);
        const double moved = engine->bodies()[1].position.head<2>().norm();
        CHECK((part < 1 ? moved < 1e-8 : moved > 1e-4));
      }
}

TEST_CASE("with equal coefficients the axis changes no bit") {
  const std::string text = block(0.3, 0.3, Vector3d(3, 2, -9.81), Vector3d(1, -1, 0));
  std::string plain = text;
  for (const std::string key : {"friction_axis", "friction_across"}) {
    const std::size_t at = plain.find(key);
    plain.erase(at, plain.find('\n', at) - at);
  }
  for (const EngineKind kind : kBoth) {
    const double accuracy = kind == EngineKind::event ? 1e-7 : 1e-2;
    const auto a = engine_of(scene_of(text), kind, accuracy);
    const auto b = engine_of(scene_of(plain), kind, accuracy);
    a->advance(1);
    b->advance(1);
    CHECK(a->bodies()[1].position == b->bodies()[1].position);
    CHECK(a->bodies()[1].angular_velocity == b->bodies()[1].angular_velocity);
  }
}

TEST_CASE("elliptic friction goes with accuracy, joints, rolling friction and impacts") {
  const std::string text = block(0.1, 0.4, Vector3d(3, 2, -9.81), Vector3d(1, -1, 0));
  const auto exact = engine_of(scene_of(text), EngineKind::event, 1e-9);
  exact->advance(1);
  const auto error = [&](const Scene& scene) {
    const auto engine = make_engine(scene);
    engine->advance(1);
    return (engine->bodies()[1].position - exact->bodies()[1].position).norm();
  };
  Scene scene = scene_of(text);
  scene.stepping.emplace().accuracy = 1e-4;
  CHECK(error(scene) < 3e-3);
  scene = scene_of(text + "rolling = 1e-3\n");
  scene.stepping.emplace().step = 1e-3;
  CHECK(error(scene) < 5e-3);
  scene = scene_of(text + R"(
[[body]]
name = "rider"
mass = 1e-9
inertia = [1e-9, 1e-9, 1e-9]
position = [0, 0, 0.05]
velocity = [1, -1, 0]
[[joint]]
kind = "fixed"
bodies = ["rider", "block"]
at = [0, 0, 0.05]
)");
  scene.stepping.emplace().step = 1e-3;
  CHECK(error(scene) < 5e-3);
}

TEST_CASE("a tripod that spins while it slides has the motion of events by steps of order 1") {
  Scene scene = scene_of(block(0.1, 0.4, Vector3d(0, 0, -9.81), Vector3d(2, 1, 0)));
  Body& body = scene.bodies[1];  // three feet: their forces are unique
  body.shapes = {tether::contact::Shape::touching_points(
      {{0.3, 0, -0.05}, {-0.2, 0.2, -0.05}, {-0.2, -0.25, -0.05}})};
  body.angular_velocity = Vector3d(0, 0, 4);
  body.friction_axis = Vector3d(0.8, 0.6, 0);
  const auto exact = engine_of(scene, EngineKind::event, 1e-9);
  exact->advance(0.5);
  double before = 0;
  for (const double step : {4e-3, 2e-3, 1e-3}) {
    const auto steps = engine_of(scene, EngineKind::stepping, step);
    steps->advance(0.5);
    const double error = (steps->bodies()[1].position - exact->bodies()[1].position).norm();
    CHECK(error < 4 * step);
    if (before > 0) CHECK(error < 0.6 * before);
    before = error;
  }
}

TEST_CASE("axes and coefficients that do not fit are refused by name") {
  const std::string text = block(0.1, 0.4, Vector3d(0, 0, -9.81));
  const auto without = [&](const std::string& line) {
    std::string out = text;
    const std::size_t at = out.find(line);
    return out.erase(at, out.find('\n', at) - at);
  };
  CHECK(contains(why_not(without("friction_axis")), "body \"block\": friction_axis"));
  CHECK(contains(why_not(without("friction_across")), "has no meaning"));
  CHECK(contains(why_not(text + "touch = false\n"), "friction_across"));
  CHECK(contains(why_not(text + "friction_acros = 1\n"), "friction_acros"));
  std::string same = text;
  same.replace(same.find("[\"ski\", \"snow\"]"), 15, "[\"ski\", \"ski\"]");
  CHECK(contains(why_not(same), "two materials"));
  CHECK(contains(why_not(text + "[stepping]\nrestitution_law = \"poisson\"\n"), "newton"));
  CHECK(contains(why_not(text + "[stepping]\nsleep = 1e-3\n"), "sleep"));
  Scene scene = scene_of(text);
  scene.bodies[1].friction_axis.reset();
  for (const auto make : {&make_stepping_engine, &make_event_engine})
    CHECK(contains(tether::test::thrown<std::invalid_argument>([&] { make(scene); }),
                   "friction_axis"));
  std::ostringstream plan;
  plan << make_plan(scene_of(text));
  CHECK(contains(plan.str(), "elliptic friction 1 pair"));
}
