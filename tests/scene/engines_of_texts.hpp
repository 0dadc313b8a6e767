// Engines of scenes that are texts. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "linalg/thrown.hpp"

namespace tether::test {

inline scene::Scene scene_of(const std::string& text) { return scene::parse_scene(text, "test"); }

/// `accuracy`: the tolerance, or the step.
inline std::unique_ptr<scene::Engine> engine_of(scene::Scene s, scene::EngineKind kind,
                                                double accuracy) {
  using scene::EngineKind;
  s.engine = kind;
  if (kind == EngineKind::smooth) s.smooth.emplace().tolerance = accuracy;
  if (kind == EngineKind::event) s.event.emplace().tolerance = accuracy;
  if (kind == EngineKind::stepping) s.stepping.emplace().step = accuracy;
  return make_engine(s);
}

/// The message with which the scene is refused; empty if it is not.
inline std::string why_not(const std::string& text) {
  return thrown<std::exception>([&] { make_engine(scene_of(text)); });
}

/// Two bodies that turn about no common axis, the second with this angular velocity, for `end` s,
/// and the joint "between" them, whose fields follow.
inline std::string two_bodies(const std::string& end, const std::string& spin,
                              const std::string& joint) {
  return "[scene]\nend = " + end + R"(
[[body]]
name = "a"
mass = 1
inertia = [0.2, 0.3, 0.4]
velocity = [0.1, 0.2, 0.3]
angular_velocity = [0.5, -0.4, 1]
[[body]]
name = "b"
mass = 3
inertia = [0.5, 0.7, 0.6]
position = [1, 0.2, 0]
velocity = [-0.1, 1.2, 0.8]
angular_velocity = )" +
         spin + R"(
[[joint]]
name = "between"
bodies = ["a", "b"]
)" + joint;
}

}  // namespace tether::test
