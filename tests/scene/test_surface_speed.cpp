// Surfaces that move on their bodies. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using Eigen::Vector3d;

namespace conveyed {

Scene on_plane(const std::string& surface, const std::string& body, double friction) {
  return parse_scene(
      "[scene]\nend = 3\ngravity = [0, 0, -9.81]\n[[body]]\nname = \"belt\"\nshape = \"plane\"\n"
      "fixed = true\nmaterial = \"belt\"\nsurface = { " +
          surface + " }\n[[body]]\nname = \"rides\"\nmass = 2\nmaterial = \"rides\"\n" + body +
          "\n[[pair]]\nbetween = [\"belt\", \"rides\"]\nfriction = " + std::to_string(friction) +
          "\n",
      "test");
}

const char* const kBox = "shape = \"box\"\nsize = [0.4, 0.4, 0.2]\nposition = [0, 0, 0.1]";
const char* const kBall =
    "shape = \"sphere\"\nradius = 0.1\nposition = [0.5, 0, 0.1]\nvelocity = [0, 0.3, 0]\n"
    "angular_velocity = [7, 0, 0]";

double on_belt(double t) {
  const double v = 1.5, a = 0.3 * 9.81;
  return t < v / a ? a * t * t / 2 : v * t - v * v / a / 2;
}

// Its centre circles with 2/7 of 2 rad/s.
Vector3d on_turntable(double t) {
  const double k = 4.0 / 7, r = 0.3 / k;
  return {0.5 + r * (std::cos(k * t) - 1), r * std::sin(k * t), 0.1};
}

}  // namespace conveyed

using namespace conveyed;

TEST_CASE("a belt takes a box along, and a ball circles on a turntable: events, to the tolerance") {
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    Scene box = on_plane("velocity = [1.5, 0, 0]", kBox, 0.3);
    Scene ball = on_plane("angular_velocity = [0, 0, 2]", kBall, 0.5);
    box.event.emplace().tolerance = ball.event.emplace().tolerance = tolerance;
    const auto a = make_engine(box), b = make_engine(ball);
    for (const double t : {0.3, 1.0, 3.0}) {
      a->advance(t);
      b->advance(t);
      INFO(tolerance << " " << t);
      CHECK(std::abs(a->bodies()[1].position.x() - on_belt(t)) < 30 * tolerance);
      CHECK((b->bodies()[1].position - on_turntable(t)).norm() < 100 * tolerance);
    }
  }
}

TEST_CASE("a belt takes a box along, and a ball circles on a turntable: steps, of order 1") {
  double last[2] = {0, 0};
  for (const double step : {1e-2, 1e-3}) {
    Scene box = on_plane("velocity = [1.5, 0, 0]", kBox, 0.3);
    Scene ball = on_plane("angular_velocity = [0, 0, 2]", kBall, 0.5);
    box.stepping.emplace().step = ball.stepping.emplace().step = step;
    const auto a = make_engine(box), b = make_engine(ball);
    a->advance(0.3);
    CHECK(std::abs(a->contacts()[0].slip.x() - (0.3 * 9.81 * 0.3 - 1.5)) < 1e-6);
    a->advance(1.5);
    b->advance(1.5);
    const double error[2] = {std::abs(a->bodies()[1].position.x() - on_belt(1.5)),
                             (b->bodies()[1].position - on_turntable(1.5)).norm()};
    for (const int k : {0, 1}) {
      INFO(step << " " << k << " " << error[k]);
      CHECK(error[k] < 2 * step);
      if (last[k] > 0) CHECK(last[k] / error[k] > 5);
      last[k] = error[k];
    }
    CHECK(std::abs(a->bodies()[1].velocity.x() - 1.5) < 1e-6);
  }
}

TEST_CASE("surface speeds are of the body's axes, and act on what carries them") {
  // A cart on tracks: its own surface moves backwards, so it drives itself forwards, turned by 90
  // degrees about the vertical.
  for (const bool events : {false, true}) {
    Scene scene = on_plane("velocity = [0, 0, 0]",
                           std::string(kBox) +
                               "\norientation = { axis = [0, 0, 1], deg = 90 }\nsurface = { "
                               "velocity = [-1.5, 0, 0] }",
                           0.3);
    if (events)
      scene.event.emplace().tolerance = 1e-8;
    else
      scene.stepping.emplace().step = 1e-3;
    const auto engine = make_engine(scene);
    engine->advance(2);
    CHECK(std::abs(engine->bodies()[1].position.y() - on_belt(2)) < (events ? 1e-6 : 2e-3));
    CHECK(std::abs(engine->bodies()[1].position.x()) < 1e-6);
  }
}

TEST_CASE("surface speeds are written, read again and refused by name") {
  const Scene scene = on_plane("velocity = [1.5, 0, 0]", kBox, 0.3);
  const Scene again = parse_scene(write_scene(scene), "again");
  REQUIRE(again.bodies[0].surface);
  CHECK(again.bodies[0].surface->velocity == Vector3d(1.5, 0, 0));
  const auto said = [](const std::string& surface) {
    return tether::test::thrown<SceneError>([&] { on_plane(surface, kBox, 0.3); });
  };
  CHECK(said("").find("give velocity") != std::string::npos);
  CHECK(said("velocity = [1, 2]").find("velocity") != std::string::npos);
  CHECK(said("speed = 3, velocity = [1, 0, 0]").find("speed") != std::string::npos);
  CHECK_THROWS(
      parse_scene("[scene]\nend = 1\n[[body]]\nname = \"a\"\nmass = 1\ninertia = [1, 1, "
                  "1]\nsurface = { velocity = [1, 0, 0] }\n",
                  "test"));
}
