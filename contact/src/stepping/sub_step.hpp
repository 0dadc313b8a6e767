// Tether: what sub-steps of a step are, and what they change. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
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

/// How a step has gone, from the best to the worst: all met, a contact problem above what is
/// accepted, joints unmet at its end.
enum class Outcome : std::uint8_t { met, unsolved, joints_unmet };

/// Outcome of a step: the worst of its sub-steps, and counts of their contact problems. Restored
/// when the same sub-step is taken again.
struct Tally {
  Status status = Status::solved;
  Outcome outcome = Outcome::met;
  void worsen(Outcome by) { outcome = std::max(outcome, by); }
  double residual = 0, deepest = 0;
  long bounces = 0, accepted = 0, unsolved = 0;
};

/// All that a sub-step changes of bodies.
struct BodiesState {
  std::vector<Eigen::Vector3d> position;
  std::vector<linalg::Quaternion> orientation;
  std::vector<RigidBody> motion;
  std::vector<StepperMemory::Spin> spin;
};

/// State to which a step may go back: bodies and warm starts.
struct StepMark {
  BodiesState bodies;
  WarmStart contacts, corrections;
};

/// Leaves the contacts k with keep(k), in their order.
template <class Keep>
void keep_contacts(StepContacts& contacts, const Keep& keep) {
  const bool pressed = contacts.impulses.size() >= contacts.points.size();
  std::size_t kept = 0;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (!keep(k)) continue;
    contacts.points[kept] = contacts.points[k];
    contacts.gaps[kept] = contacts.gaps[k];
    if (pressed) contacts.impulses[kept] = contacts.impulses[k];
    ++kept;
  }
  contacts.points.resize(kept);
  contacts.gaps.resize(kept);
  if (pressed) contacts.impulses.resize(kept);
}

/// Adds the impulses of `part` by identity: those of a step are sums over its sub-steps and
/// impacts.
void add_impulses(const StepContacts& part, StepContacts& sum);

inline void push(RigidBody& body, const Eigen::Vector3d& r, const Eigen::Vector3d& p) {
  body.velocity += body.inverse_mass * p;
  body.angular_velocity += body.inverse_inertia * r.cross(p);
}

/// Gives all bodies that move the velocities of a solution.
inline void take_velocities(const BodySolution& from, BodySet& bodies) {
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (bodies.mass[i] == 0) continue;
    bodies.motion[i].velocity = from.velocities[i];
    bodies.motion[i].angular_velocity = from.angular_velocities[i];
  }
}

}  // namespace tether::contact::detail
