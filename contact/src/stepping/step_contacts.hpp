// Tether: contacts and velocities of a step, as its parts change them.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

namespace tether::contact::detail {

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

/// Velocities of all bodies without these.
inline void subtract(std::vector<RigidBody>& from, const std::vector<RigidBody>& velocities) {
  for (std::size_t i = 0; i < from.size(); ++i) {
    from[i].velocity -= velocities[i].velocity;
    from[i].angular_velocity -= velocities[i].angular_velocity;
  }
}

}  // namespace tether::contact::detail
