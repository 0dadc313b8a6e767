// Tether: the bodies of a smooth scene and their unknowns. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

#include "mechanics/force.hpp"

namespace tether::scene::smooth {

using namespace mechanics;

/// y holds for each moving body x, q (wxyz, body to world), v, w (body axes), by slot.
class MovingBodies {
 public:
  /// Throws std::invalid_argument, naming a body without mass or inertia or a fixed one that moves.
  explicit MovingBodies(const Scene& scene);

  const Bodies& all() const { return bodies_; }
  int count() const { return bodies_.moving; }
  int body(int slot) const { return body_of_slot_[at(slot)]; }
  const Inertia& inertia(int slot) const { return bodies_.inertia[at(body(slot))]; }
  const Frame<double>& frame(int slot) const { return bodies_.frames[at(body(slot))]; }
  Frame<double>& frame(int slot) { return bodies_.frames[at(body(slot))]; }
  const Vector3d& spin(int slot) const { return bodies_.w[at(body(slot))]; }  ///< body axes
  const std::vector<double>& start() const { return start_; }  ///< y at the start of a run

  void set_time(double t) { bodies_.time = t; }
  void begin_anew(double t) { bodies_.since = t; }
  void set_state(const double* y);  ///< frames, without accelerations
  /// of the state that is set
  void set_accelerations(const double* yp) {
    for (int k = 0; k < count(); ++k) {
      Frame<double>& f = frame(k);
      f.a = Eigen::Map<const Vector3d>(yp + kBody * k + kVelocity);
      f.alpha = f.R * Eigen::Map<const Vector3d>(yp + kBody * k + kSpin);
    }
  }
  /// for derivatives by quaternions
  void set_turns(const double* y) {
    for (int k = 0; k < count(); ++k)
      bodies_.turns[at(k)] = turn_of_quaternion(y + kBody * k + kQuaternion);
  }
  void read(const double* y, std::vector<BodyState>& out) const;

  /// X <- M^-1 X, 6 rows a body: velocity, angular velocity in its axes.
  void divide_by_mass(Eigen::Ref<Eigen::MatrixXd> X) const {
    for (int k = 0; k < count(); ++k) {
      X.middleRows<3>(6 * k) /= inertia(k).mass;
      X.middleRows<3>(6 * k + 3) = (inertia(k).inverse * X.middleRows<3>(6 * k + 3)).eval();
    }
  }
  double kinetic_energy() const {
    double sum = 0;
    for (int k = 0; k < count(); ++k) {
      const Vector3d& w = spin(k);
      sum += 0.5 * (inertia(k).mass * frame(k).v.squaredNorm() + w.dot(inertia(k).inertia * w));
    }
    return sum;
  }
  Vector3d momentum() const {
    Vector3d sum = Vector3d::Zero();
    for (int k = 0; k < count(); ++k) sum += inertia(k).mass * frame(k).v;
    return sum;
  }
  /// about the origin
  Vector3d angular_momentum() const {
    Vector3d sum = Vector3d::Zero();
    for (int k = 0; k < count(); ++k)
      sum += inertia(k).mass * frame(k).x.cross(frame(k).v) +
             frame(k).R * (inertia(k).inertia * spin(k));
    return sum;
  }

 private:
  Bodies bodies_;
  std::vector<int> body_of_slot_;
  std::vector<double> start_;
};

/// Rows of joints, or bodies, each with a norm to keep: below, dense factors cost less.
constexpr int kManyRows = 48;
inline bool by_entries(int rows, int bodies) { return rows >= kManyRows || bodies >= kManyRows; }
/// Unknowns of IDA from which KLU is faster than the dense solver.
constexpr int kManyUnknowns = 80;

}  // namespace tether::scene::smooth
