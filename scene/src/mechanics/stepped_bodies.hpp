// Tether: the bodies of the stepping engine, as forces see them. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

#include "bodies.hpp"

namespace tether::scene::mechanics {

/// A view of a BodySet with the same bodies. Impulses change the velocities of both.
class SteppedBodies {
 public:
  explicit SteppedBodies(const Scene& scene);

  const Bodies& bodies() const { return bodies_; }
  /// A step from `time` on.
  void set_time(double time, double span) {
    bodies_.time = time;
    bodies_.span = span;
  }
  /// Before the first force of a step, to whose velocities its weight has added `weight`.
  void begin(const contact::BodySet& set, const Vector3d& weight);
  /// The bodies with the velocities at the start of the step and what damp() has changed since.
  const Bodies& before_forces() const { return before_; }
  void damp(int body, double dt, const Vector3d& force, const Vector3d& torque);

  /// Takes over positions and velocities; later calls change `set`.
  void read(contact::BodySet& set);
  /// Both, for what changes nothing.
  void look_at(const contact::BodySet& set);
  /// Positions only, for energies.
  void read_positions(const contact::BodySet& set);

  const contact::RigidBody& motion(int body) const { return set_->motion[at(body)]; }
  void set_velocity(int body, const Vector3d& velocity, const Vector3d& angular_velocity);
  /// v += dt force / m, w += dt I^-1 torque; world axes. Fixed bodies stay.
  void push(int body, double dt, const Vector3d& force, const Vector3d& torque);

  /// Room for the sum of the forces on each moving body.
  std::vector<Load6>& loads() { return loads_; }

 private:
  contact::BodySet* set_ = nullptr;
  Bodies bodies_, before_;
  std::vector<Load6> loads_;
};

}  // namespace tether::scene::mechanics
