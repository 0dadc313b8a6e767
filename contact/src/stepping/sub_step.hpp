// Tether: what sub-steps of a step are. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/stepping.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

/// A span of time that is taken at once or, if that fails, in shorter sub-steps.
struct SubStep {
  double start = 0, length = 0;  ///< s
  /// Remaining halvings for unsolved contact problems and for joints that are not met; remaining
  /// cuts at impacts.
  int halvings = 0, joint_halvings = 0, cuts = 0;
  /// Whether it is a whole step or lies within a cut one, taken island by island or for all bodies.
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

/// How a sub-step ended: whole, or early without having moved anything. Early: contact problem
/// unsolved, joints unmet, an impact to cut at, a body woken.
enum class SubStepEnd : std::uint8_t { whole, unsolved, unmet, cut, woken };

/// Outcome of the contact problems of a step: the worst of its sub-steps, and counts. Restored when
/// the same sub-step is taken again.
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
