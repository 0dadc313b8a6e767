// Tether: what sub-steps of a step are. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/stepping.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

/// Length of time that is taken at once or, where that fails, in sub-steps of its own.
struct SubStep {
  double start = 0, length = 0;  ///< s
  /// Halvings that are left, where its contact problem is not solved and where its joints cannot be
  /// met; and cuts at impacts.
  int halvings = 0, joint_halvings = 0, cuts = 0;
  /// A step that is cut may have its islands apart from each other, or not.
  enum class Within : std::uint8_t { step, cut_by_islands, cut } within = Within::step;
  /// Its place in a cut: up to the impact, or after it.
  enum class Side : std::uint8_t { none, approach, rest } side = Side::none;
  const std::vector<char>* active = nullptr;  ///< bodies that take part; null: all

  SubStep over(double from, double time) const {
    SubStep s = *this;
    s.start = from;
    s.length = time;
    return s;
  }
  bool has(int body) const { return active == nullptr || (*active)[linalg::at(body)] != 0; }
};

/// Why a sub-step ends before its last stage, if it does: its problem, its joints, an impact on the
/// way, or a body that has woken. Nothing has moved then.
enum class SubStepEnd : std::uint8_t { whole, unsolved, unmet, cut, woken };

/// How the contact problems of a step have ended, the worst of its sub-steps, and how many. One
/// that is taken again is judged as if it had not been taken before.
struct Tally {
  Status status = Status::solved;
  bool succeeded = true, joints_met = true;
  double residual = 0, deepest = 0;
  long bounces = 0, accepted = 0, unsolved = 0;
};

/// All that a sub-step changes of bodies.
struct BodiesState {
  std::vector<Eigen::Vector3d> position;
  std::vector<linalg::Quaternion> orientation;
  std::vector<RigidBody> motion;
  std::vector<FreeSpin> spin;
};

/// State to which a step may go back: bodies and warm starts.
struct StepMark {
  BodiesState bodies;
  WarmStart contacts, corrections;
};

}  // namespace tether::contact::detail
