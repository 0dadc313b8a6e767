// Coefficients of contacts that hold and of those that slip. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "engines_of_texts.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;

namespace static_friction {

constexpr double kFall = 9.81, kHolds = 0.5, kSlips = 0.3, kMass = 2;
constexpr EngineKind kBoth[] = {EngineKind::event, EngineKind::stepping};

std::string on_floor(const std::string& gravity, const std::string& velocity,
                     const std::string& floor, const std::string& more) {
  return fmt::format(R"(
[scene]
end = 12
gravity = {}
[[body]]
name = "floor"
fixed = true
shape = "plane"
material = "floor"
{}
[[body]]
name = "block"
shape = "box"
size = [0.6, 0.4, 0.1]
mass = {}
position = [0, 0, 0.05]
velocity = {}
material = "block"
[[pair]]
between = ["block", "floor"]
friction = {}
static_friction = {}
{})",
                     gravity, floor, kMass, velocity, kSlips, kHolds, more);
}

std::string incline(double slope) {
  return on_floor(fmt::format("[{}, 0, {}]", kFall * std::sin(slope), -kFall * std::cos(slope)),
                  "[0, 0, 0]", "", "");
}

// Pulled by 4 t.
constexpr double kPull = 4;
const std::string kPulled =
    on_floor("[0, 0, -9.81]", "[0, 0, 0]", "",
             "[[load]]\nbody = \"block\"\nforce = [4, 0, 0]\ntable = [[0, 0], [10, 10]]\n");

// On a belt, held by a spring.
constexpr double kSpeed = 0.2, kSpring = 50;
const std::string kOnBelt =
    on_floor("[0, 0, -9.81]", "[0.2, 0, 0]", "surface = { velocity = [0.2, 0, 0] }",
             "[[spring]]\nbodies = [\"world\", \"block\"]\nat = [[-3, 0, 0.05], [0, 0, 0.05]]\n"
             "stiffness = 50\n");

/// It holds up to x_s, slips about x_k, and holds again at 2 x_k - x_s, where it has the speed of
/// the belt.
struct StickSlip {
  double end = kHolds * kMass * kFall / kSpring, middle = kSlips * kMass * kFall / kSpring;
  double w = std::sqrt(kSpring / kMass), D = end - middle;
  double held = 2 * D / kSpeed, slips = 2 / w * (M_PI - std::atan(D * w / kSpeed));
  double period() const { return held + slips; }
  double most() const { return middle + std::hypot(D, kSpeed / w); }
  /// From 0 on, which is within the first time that it holds.
  double at(double t) const {
    const double first = end / kSpeed;
    if (t < first) return kSpeed * t;
    double since = std::fmod(t - first, period());
    if (since < slips) return middle + D * std::cos(w * since) + kSpeed / w * std::sin(w * since);
    return middle - D + kSpeed * (since - slips);
  }
};

double place(const Engine& run) { return run.bodies()[1].position.x(); }

TEST_CASE("a block holds on an incline up to its static coefficient, and slides by the other one") {
  for (const EngineKind kind : kBoth)
    for (const double part : {0.61, 0.99, 1.01}) {
      const double slope = std::atan(part * kHolds);
      const auto run =
          engine_of(scene_of(incline(slope)), kind, kind == EngineKind::event ? 1e-9 : 1e-3);
      run->advance(1);
      const double a = kFall * (std::sin(slope) - kSlips * std::cos(slope));
      INFO(run->name() << " " << part << " " << run->bodies()[1].velocity.x());
      CHECK(std::abs(run->bodies()[1].velocity.x() - (part < 1 ? 0 : a)) < 1e-7);
    }
}

TEST_CASE("a block that slides when it is put down stops by the kinetic coefficient") {
  const double speed = 1, stop = speed / (kSlips * kFall);
  for (const EngineKind kind : kBoth) {
    const auto run = engine_of(scene_of(on_floor("[0, 0, -9.81]", "[1, 0, 0]", "", "")), kind,
                               kind == EngineKind::event ? 1e-9 : 1e-4);
    run->advance(0.5 * stop);
    CHECK(std::abs(run->bodies()[1].velocity.x() - 0.5 * speed) <
          (kind == EngineKind::event ? 1e-8 : 1e-3));
    run->advance(1);
    INFO(run->name());
    CHECK(std::abs(place(*run) - 0.5 * speed * stop) < (kind == EngineKind::event ? 1e-7 : 2e-4));
    CHECK(std::abs(run->bodies()[1].velocity.x()) < 1e-9);
  }
}

TEST_CASE("a block under a rising pull breaks loose at the static coefficient") {
  const double loose = kHolds * kMass * kFall / kPull;
  const auto speed = [&](double t) {
    return (0.5 * kPull * (t * t - loose * loose) - kSlips * kMass * kFall * (t - loose)) / kMass;
  };
  const Scene scene = scene_of(kPulled);
  // Four corners share their forces: accelerations are known to 3e-8 of gravity, the pull grows by
  // 2 m/s^3.
  constexpr double kNoise = 1e-7;
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    const auto run = engine_of(scene, EngineKind::event, tolerance);
    run->advance(0.99 * loose);
    CHECK(std::abs(place(*run)) < 1e-12);
    run->advance(4);
    INFO(tolerance << " " << run->bodies()[1].velocity.x() - speed(4));
    CHECK(std::abs(run->bodies()[1].velocity.x() - speed(4)) < 300 * tolerance + kNoise);
    REQUIRE(!run->events().empty());
    CHECK(run->events().front().kind == ContactEvent::Kind::slip);
    CHECK(std::abs(run->events().front().time - loose) < 100 * tolerance + kNoise);
  }
  double last = 0;
  for (const double step : {1.3e-2, 1.3e-2 / 4, 1.3e-2 / 16}) {
    const auto run = engine_of(scene, EngineKind::stepping, step);
    run->advance(4);
    const double error = std::abs(run->bodies()[1].velocity.x() - speed(run->time()));
    INFO(step << " " << error);
    CHECK(error < 5 * step);
    last = error;
  }
  CHECK(last < 2e-3);
}

TEST_CASE("a block on a belt sticks and slips with the period and amplitude of the closed form") {
  const StickSlip law;
  const Scene scene = scene_of(kOnBelt);
  for (const double tolerance : {1e-6, 1e-8}) {
    const auto run = engine_of(scene, EngineKind::event, tolerance);
    double most = 0, error = 0;
    for (double t = 0.05; t < 8; t += 0.05) {
      run->advance(t);
      most = std::max(most, place(*run));
      error = std::max(error, std::abs(place(*run) - law.at(t)));
    }
    INFO(tolerance << " " << error);
    CHECK(error < 1000 * tolerance);
    std::vector<double> slips;
    for (const ContactEvent& each : run->events())
      if (each.kind == ContactEvent::Kind::slip &&
          (slips.empty() || each.time > slips.back() + 0.1))
        slips.push_back(each.time);
    REQUIRE(slips.size() >= 3);
    for (std::size_t k = 1; k < slips.size(); ++k)
      CHECK(std::abs(slips[k] - slips[k - 1] - law.period()) < 1000 * tolerance);
  }
  double last = 0;
  for (const double step : {4e-3, 1e-3, 2.5e-4}) {
    const auto run = engine_of(scene, EngineKind::stepping, step);
    double error = 0, most = 0;
    for (double t = 0.05; t < 8; t += 0.05) {
      run->advance(t);
      most = std::max(most, place(*run));
      error = std::max(error, std::abs(place(*run) - law.at(run->time())));
    }
    INFO(step << " " << error);
    CHECK(error < 30 * step);
    CHECK(std::abs(most - law.most()) < 3 * step + 1e-3);
    if (last > 0) CHECK(last / error > 2);
    last = error;
  }
}

TEST_CASE("an ellipse of static friction holds a block, and the other one slows it") {
  // Along x .3 and .5, across it .12 and .2: the pull is on a line between.
  constexpr double kAcross = 0.12, kGrows = kHolds / kSlips;
  for (const double turn : {0.3, 0.8, 1.3}) {
    const double c = std::cos(turn), s = std::sin(turn);
    const double most = kFall * kGrows / std::hypot(c / kSlips, s / kAcross);
    for (const double part : {0.99, 1.01})
      for (const EngineKind kind : kBoth) {
        std::string text =
            on_floor(fmt::format("[{}, {}, {}]", part * most * c, part * most * s, -kFall),
                     "[0, 0, 0]", "", fmt::format("friction_across = {}\n", kAcross));
        text.insert(text.find("material = \"block\""), "friction_axis = [1, 0, 0]\n");
        const auto run = engine_of(scene_of(text), kind, kind == EngineKind::event ? 1e-9 : 1e-3);
        run->advance(0.5);
        const Eigen::Vector2d v = run->bodies()[1].velocity.head<2>();
        INFO(run->name() << " " << turn << " " << part << " " << v.transpose());
        if (part < 1) {
          CHECK(v.norm() < 1e-7);
          continue;
        }
        // Along the slip e: pull - g M^2 e / |M e| = a e.
        const Eigen::Vector2d e = v.normalized(), m(kSlips, kAcross),
                              law = kFall * m.cwiseProduct(m).cwiseProduct(e) /
                                    m.cwiseProduct(e).norm(),
                              left = part * most * Eigen::Vector2d(c, s) - law;
        CHECK(left.norm() > 0.3);
        CHECK((v - 0.5 * left).norm() < 1e-5);
      }
  }
  std::string none = on_floor("[0, 0, -9.81]", "[0, 0, 0]", "", "friction_across = 0.1\n");
  none.replace(none.find("friction = 0.3"), 14, "friction = 0");
  CHECK(why_not(none).find("static_friction") != std::string::npos);
}

TEST_CASE("static_friction is written, read again, planned, and refused by name") {
  const Scene scene = scene_of(kOnBelt);
  const Scene again = parse_scene(write_scene(scene), "again");
  CHECK(again.pairs[0].static_friction == kHolds);
  CHECK(write_scene(again) == write_scene(scene));
  bool planned = false;
  for (const Effect& each : make_plan(scene).effects)
    planned = planned || (each.name == "static friction" && each.detail == "1 pair of materials");
  CHECK(planned);
  const auto refused = [&](const std::string& to) {
    std::string text = kOnBelt;
    text.replace(text.find("static_friction = 0.5"), 21, to);
    const std::string message = why_not(text);
    INFO(to << ": " << message);
    const std::size_t first = message.find("static_friction");
    CHECK(first != std::string::npos);
    CHECK(message.find("static_friction:", first + 1) == std::string::npos);
  };
  refused("static_friction = 0.2");
  refused("static_friction = -1");
  refused("static_friction = nan");
  std::string apart = kOnBelt;
  apart.replace(apart.find("friction = 0.3"), 14, "touch = false");
  CHECK(why_not(apart).find("static_friction") != std::string::npos);
}

}  // namespace static_friction
