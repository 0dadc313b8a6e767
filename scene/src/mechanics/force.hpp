// Tether: the forces that one effect exerts in one scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>
#include <utility>
#include <vector>

#include "frames.hpp"

namespace tether::scene::mechanics {

/// `slot`: index among the moving bodies, -1: it does not move.
struct Inertia {
  int slot = -1;
  double mass = 0;                                                  ///< kg
  Matrix3d inertia = Matrix3d::Zero(), inverse = Matrix3d::Zero();  ///< body axes, kg m^2
};

/// All bodies of a scene, then the world.
struct Bodies {
  std::vector<Inertia> inertia;
  std::vector<Frame<double>> frames;
  std::vector<Vector3d> w;                         ///< angular velocities in body axes
  std::vector<Eigen::Matrix<double, 3, 4>> turns;  ///< of the moving bodies: turn_of_quaternion
  int moving = 0;
  double time = 0, span = 0;  ///< s; forces are means from `time` on over `span`, 0: of that time
  double since = -1;          ///< when the motion began anew: forces that jump then have jumped

  int world() const { return static_cast<int>(inertia.size()) - 1; }
  bool moves(int body) const { return inertia[at(body)].slot >= 0; }
  /// Index of a body of the scene, where -1 is the world.
  int index(int body) const { return body < 0 ? world() : body; }
  /// Gives a body a state, without accelerations.
  void put(int body, const BodyState& state) {
    Frame<double>& f = frames[at(body)];
    f.x = state.position;
    f.R = state.orientation.toRotationMatrix();
    f.v = state.velocity;
    f.W = state.angular_velocity;
    w[at(body)] = f.R.transpose() * f.W;
  }
};

/// Body `body` of the contact library's set, to read and to set.
BodyState state_of(const contact::BodySet& set, int body);
void put_state(const BodyState& state, int body, contact::BodySet& set);

/// Point `p` and direction `u` of world axes in the axes of a body.
inline Vector3d point_in(const Frame<double>& f, const Vector3d& p) {
  return f.R.transpose() * (p - f.x);
}
inline Vector3d direction_in(const Frame<double>& f, const Vector3d& u) {
  return f.R.transpose() * u;
}

/// Sum of the forces on a body: force in world axes (N), torque about the centre in body axes and,
/// apart from it, torque in world axes (N m).
struct Load6 {
  Vector3d force, torque_body, torque_world;
};
inline void clear(std::vector<Load6>& loads) {
  for (Load6& load : loads) load.force = load.torque_body = load.torque_world = Vector3d::Zero();
}

/// Frames of all bodies and, last, of the world: positions and attitudes of the scene, at rest; no
/// inertia, and nothing moves yet.
Bodies placed_bodies(const Scene& scene);
/// The same with the inertia of those that move.
Bodies weighed_bodies(const Scene& scene);
/// The places of all bodies in the scene, at rest.
std::vector<BodyState> placed_states(const Scene& scene);

/// The assembly makes the same calls of add() in the same order every time. So it runs once to
/// record places; afterwards an entry goes to the slot of the same call, in any storage.
class Entries {
 public:
  std::vector<std::pair<int, int>> places;  ///< row, column of each call

  void record() {
    places.clear();
    values_ = nullptr;
  }
  void finish(std::vector<int> slots) { slots_ = std::move(slots); }
  const std::vector<int>& slots() const { return slots_; }
  /// `values`: zero on entry.
  void begin(double* values) {
    values_ = values;
    next_ = 0;
  }
  void add(int row, int column, double value) {
    if (values_ == nullptr)
      places.emplace_back(row, column);
    else
      values_[slots_[next_++]] += value;
  }

 private:
  std::vector<int> slots_;
  std::size_t next_ = 0;
  double* values_ = nullptr;  // null: it records
};

/// 3 x 4: the turn in body axes that a change of the quaternion (wxyz) means, for R(q / |q|).
inline Eigen::Matrix<double, 3, 4> turn_of_quaternion(const double* q) {
  Eigen::Matrix<double, 3, 4> L;
  L << -q[1], q[0], q[3], -q[2],  //
      -q[2], -q[3], q[0], q[1],   //
      -q[3], q[2], -q[1], q[0];
  return L * (2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]));
}

/// Unknowns of one body.
constexpr int kPosition = 0, kQuaternion = kPosition + 3, kVelocity = kQuaternion + 4,
              kSpin = kVelocity + 3, kBody = kSpin + 3;

/// Writes derivatives into rows of a matrix whose columns are the unknowns.
class JacobianBlocks {
 public:
  JacobianBlocks(Entries& entries, const std::vector<Eigen::Matrix<double, 3, 4>>& turns,
                 int stride, int offset, int row_of_work)
      : work_row(row_of_work), entries_(entries), turns_(turns), stride_(stride), offset_(offset) {}

  const int work_row;

  /// Row of component i = 0 .. 5 of the equations of motion of a moving body.
  int motion_row(int slot, int i) const { return stride_ * slot + offset_ + i; }
  void add(int row, int column, double value) { entries_.add(row, column, value); }

  /// factor * d, the 12 directions of a moving body from `first` on.
  void add_directions(int row, int slot, const Derivatives& d, int first, double factor) {
    const int column = kBody * slot;
    for (int k = 0; k < 3; ++k) add(row, column + kPosition + k, factor * d[first + k]);
    const Eigen::RowVector4d quaternion =
        factor * d.segment<3>(first + 3).transpose() * turns_[static_cast<std::size_t>(slot)];
    for (int k = 0; k < 4; ++k) add(row, column + kQuaternion + k, quaternion[k]);
    for (int k = 0; k < 6; ++k) add(row, column + kVelocity + k, factor * d[first + 6 + k]);
  }
  /// The same where `body` moves.
  void add_body(int row, const Bodies& bodies, int body, const Derivatives& d, int first,
                double factor) {
    if (const int slot = bodies.inertia[at(body)].slot; slot >= 0)
      add_directions(row, slot, d, first, factor);
  }
  void add_block(int row, int column, const Matrix3d& block) {
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) add(row + i, column + k, block(i, k));
  }

 private:
  Entries& entries_;
  const std::vector<Eigen::Matrix<double, 3, 4>>& turns_;
  int stride_, offset_;
};

/// A view of a BodySet with the same bodies. Impulses change the velocities of both.
class SteppedBodies {
 public:
  explicit SteppedBodies(const Scene& scene)
      : bodies_(weighed_bodies(scene)), before_(bodies_), loads_(at(bodies_.moving)) {}

  const Bodies& bodies() const { return bodies_; }
  /// A step from `time` on.
  void set_time(double time, double span) {
    bodies_.time = time;
    bodies_.span = span;
  }
  /// Before the first force of a step, to whose velocities its weight has added `weight`.
  void begin(const contact::BodySet& set, const Vector3d& weight) {
    for (int b = 0; b < set.size(); ++b) {
      if (!bodies_.moves(b)) continue;
      before_.put(b, state_of(set, b));
      before_.frames[at(b)].v -= weight;
    }
  }
  /// The bodies with the velocities at the start of the step and what damp() has changed since.
  const Bodies& before_forces() const { return before_; }
  void damp(int body, double dt, const Vector3d& force, const Vector3d& torque) {
    push(body, dt, force, torque);
    if (!bodies_.moves(body)) return;
    Frame<double>& f = before_.frames[at(body)];
    f.v += dt * motion(body).inverse_mass * force;
    f.W += dt * (motion(body).inverse_inertia * torque);
  }

  /// Takes over positions and velocities; later calls change `set`.
  void read(contact::BodySet& set) {
    set_ = &set;
    copy(set);
  }
  /// The same, for what changes nothing.
  void copy(const contact::BodySet& set) {
    for (int b = 0; b < set.size(); ++b)
      if (bodies_.moves(b)) bodies_.put(b, state_of(set, b));
  }

  const contact::RigidBody& motion(int body) const { return set_->motion[at(body)]; }
  void set_velocity(int body, const Vector3d& velocity, const Vector3d& angular_velocity) {
    contact::RigidBody& motion = set_->motion[at(body)];
    Frame<double>& f = bodies_.frames[at(body)];
    motion.velocity = f.v = velocity;
    motion.angular_velocity = f.W = angular_velocity;
    bodies_.w[at(body)] = f.R.transpose() * f.W;
  }
  /// v += dt force / m, w += dt I^-1 torque; world axes. Fixed bodies stay.
  void push(int body, double dt, const Vector3d& force, const Vector3d& torque) {
    if (!bodies_.moves(body)) return;
    const contact::RigidBody& motion = set_->motion[at(body)];
    set_velocity(body, motion.velocity + dt * motion.inverse_mass * force,
                 motion.angular_velocity + dt * (motion.inverse_inertia * torque));
  }

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
