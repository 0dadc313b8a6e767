// Tether: the forces that one effect exerts in one scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

#include "bodies.hpp"
#include "entries.hpp"

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
  void copy_motions(const contact::BodySet& set);
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

/// The smooth engine takes forces, derivatives, potential and power; the stepping engine changes
/// velocities by impulses and takes the potential. Positions, velocities and forces in world axes,
/// angular velocities `w` and `torque_body` in body axes.
class Force {
 public:
  virtual ~Force() = default;
  virtual const char* name() const = 0;

  /// Adds to the loads of the moving bodies, by slot.
  virtual void add(const Bodies& bodies, std::vector<Load6>& loads) const = 0;
  /// Adds minus the derivatives of the force and of the torque in body axes.
  virtual void add_jacobian(const Bodies&, JacobianBlocks&) const {}

  virtual double potential(const Bodies&) const { return 0.0; }  ///< J
  /// Adds the gradient of the potential to a row of y.
  virtual void add_potential_gradient(const Bodies&, double*) const {}

  /// Whether a part of the force has no potential here; its power, W, and minus the derivatives of
  /// that in JacobianBlocks::work_row.
  virtual bool has_power() const { return false; }
  virtual double power(const Bodies&) const { return 0.0; }
  virtual void add_power_jacobian(const Bodies&, JacobianBlocks&) const {}

  /// Adds what it knows of the forces of its items.
  virtual void report(const Bodies&, Forces&) const {}

  enum class Stepping {
    by_contact,  ///< a part of the contact library's own step
    explicit_,   ///< impulses of the velocities so far
    implicit     ///< needs the velocities that all others leave: acts after them
  };
  virtual Stepping stepping() const { return Stepping::explicit_; }
  /// Throws std::invalid_argument where steps of dt are not stable.
  virtual void check_step(const Scene&, const Bodies&, double /*dt*/) const {}
  /// Changes velocities as the force does in dt.
  virtual void step(SteppedBodies& bodies, double dt) const;
};

}  // namespace tether::scene::mechanics
