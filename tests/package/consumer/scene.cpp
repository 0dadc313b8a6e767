// Smallest user of tether::scene: a pendulum by hand and a ball that falls on a plane from a text.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <tether/scene.hpp>

namespace ts = tether::scene;

namespace {

bool swings() {
  ts::Scene scene;
  scene.end = 0.5;
  scene.gravity = Eigen::Vector3d(0, 0, -9.81);
  ts::Body bob;
  bob.name = "bob";
  bob.mass = 1;
  bob.inertia = 1e-4 * Eigen::Matrix3d::Identity();
  bob.position = Eigen::Vector3d(1, 0, 0);
  scene.bodies.push_back(bob);
  ts::Joint pin;
  pin.kind = ts::JointKind::ball;
  pin.first = 0;
  scene.joints.push_back(pin);
  const ts::RunResult result = ts::run(scene);
  std::printf("%s engine, energy changes by %.1e J\n", result.engine.c_str(),
              result.summary.largest_change);
  return result.failure.empty() && std::fabs(result.summary.largest_change) < 1e-4;
}

bool falls() {
  const ts::Scene scene = ts::parse_scene(R"(
scene = { end = 1.0, gravity = [0, 0, -9.81] }
[[body]]
name = "ground"
shape = "plane"
fixed = true
material = "any"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.5]
material = "any"
[[pair]]
between = ["any", "any"]
[[expect]]
quantity = "position"
body = "ball"
value = [0, 0, 0.1]
within = 1e-3
)",
                                          "falls");
  return ts::run(scene).met();
}

bool refused() {
  try {
    ts::parse_scene("nonsense = 1", "nonsense");
  } catch (const ts::SceneError& e) {  // by its type, across the border of the library
    return !e.problems().empty();
  }
  return false;
}

}  // namespace

bool use_scene() { return swings() && falls() && refused(); }
