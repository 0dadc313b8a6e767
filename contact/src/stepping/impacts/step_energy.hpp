// Tether: energy that a body gains in a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/rotation.hpp"
#include "stepping/step_contacts.hpp"

namespace tether::contact::detail {

/// Kinetic energy of body i with velocities `now` against `came`, J.
inline double kinetic_gain(const BodySet& bodies, std::size_t i, const RigidBody& now,
                           const RigidBody& came) {
  const Eigen::Vector3d dw = now.angular_velocity - came.angular_velocity;
  return 0.5 * bodies.mass[i] * (now.velocity - came.velocity).dot(now.velocity + came.velocity) +
         0.5 * spin(bodies.inertia[i], bodies.orientation[i], dw)
                   .dot(now.angular_velocity + came.angular_velocity);
}

/// Work of the forces of a step on body i, which have changed its velocities by those of `change`:
/// their impulse times the velocities `now` that it moves with. For a weight it is the potential
/// energy that is lost, exactly.
inline double work(const BodySet& bodies, std::size_t i, const RigidBody& change,
                   const RigidBody& now) {
  return bodies.mass[i] * change.velocity.dot(now.velocity) +
         spin(bodies.inertia[i], bodies.orientation[i], change.angular_velocity)
             .dot(now.angular_velocity);
}

/// Velocities that the forces of a step add.
inline void add_of_forces(const Impacts& impacts, std::vector<RigidBody>& change) {
  change = impacts.free();
  subtract(change, impacts.coming());
}

}  // namespace tether::contact::detail
