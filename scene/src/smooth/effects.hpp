// Tether: forces of a smooth scene, one class for each effect. SPDX-License-Identifier:
// BSD-3-Clause
//
// Only the effects that a scene names are in the system's list.
#pragma once

#include <memory>
#include <tether/scene/scene.hpp>
#include <vector>

#include "entries.hpp"
#include "frames.hpp"

namespace tether::scene::smooth {

/// What a body is to the equations. `slot`: which one of the moving bodies, -1: it does not move.
struct Inertia {
  int slot = -1;
  double mass = 0;
  Matrix3d inertia = Matrix3d::Zero(), inverse = Matrix3d::Zero();
};

/// All bodies, then the world.
struct Bodies {
  std::vector<Inertia> inertia;
  std::vector<Frame<double>> frames;
  std::vector<Vector3d> w;                         ///< angular velocities in body axes
  std::vector<Eigen::Matrix<double, 3, 4>> turns;  ///< of the moving bodies: turn_of_quaternion
  int moving = 0;

  bool moves(int body) const { return inertia[static_cast<std::size_t>(body)].slot >= 0; }
};

/// Sum of the forces on a body: force in world axes, torque about the centre in body axes, and
/// torque in world axes that is turned into body axes at the end.
struct Load6 {
  Vector3d force, torque_body, torque_world;
};

class Effect {
 public:
  virtual ~Effect() = default;
  virtual const char* name() const = 0;
  virtual void add(const Bodies& bodies, std::vector<Load6>& loads) const = 0;
  /// Adds minus the derivatives of the force and of the torque in body axes.
  virtual void add_jacobian(const Bodies&, JacobianBlocks&) const {}
  virtual double potential(const Bodies&) const { return 0.0; }
  /// Adds the gradient of the potential to a row of y.
  virtual void add_potential_gradient(const Bodies&, double*) const {}
  /// Power of what has no potential here.
  virtual bool has_power() const { return false; }
  virtual double power(const Bodies&) const { return 0.0; }
  virtual void add_power_jacobian(const Bodies&, JacobianBlocks&) const {}
};

/// Those that the scene names, in the order of the plan. The world is body `scene.bodies.size()`.
std::vector<std::unique_ptr<Effect>> make_effects(const Scene& scene, const Bodies& bodies);

}  // namespace tether::scene::smooth
