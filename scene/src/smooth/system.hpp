// Tether: the equations of motion of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
//
// Unknowns: for each moving body x, q (wxyz, body to world), v, w (body axes); then the work of
// forces without potential if energy is kept with them; then the multipliers lambda.
//
//   index 1        x' = v, q' = q (0, w) / 2, M (v', w') = f + G^T lambda, g'' = 0
//   index 0        the same with lambda eliminated: G M^-1 G^T lambda = -(gamma + G M^-1 f)
//
// Rows may depend on each other, everywhere (planar linkages of 3-D hinges, Bricard's) or at a dead
// point. So index 1 gives multipliers to as many rows as are independent along the motion, and
// holds the others at 0; see rows_in_use.cpp. A diagonal term eps lambda in their place acts
// through eps / pivot^2: at tight tolerances it bends the motion at a singular position, and IDA
// does not get through. Index 0 has it (eps = 1e-11 of the diagonal, refined three times, so to the
// third power).
#pragma once

#include <chrono>
#include <tether/ida_projection.hpp>

#include "effects/list.hpp"
#include "joints/joint_rows.hpp"
#include "smooth/rows/rows_in_use.hpp"
#include "smooth/terms.hpp"

namespace tether::scene::smooth {

/// Seconds for each of a few parts. A null pointer in its place measures nothing.
class Stopwatch {
 public:
  explicit Stopwatch(std::size_t parts) : seconds(parts, 0.0) {}
  std::vector<double> seconds;

  void start() { last_ = Clock::now(); }
  void lap(std::size_t part) {
    const Clock::time_point now = Clock::now();
    seconds[part] += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_;
};

class System {
 public:
  /// `scene` is in these units already; they are for figures in messages.
  explicit System(const Scene& scene, const Units& units = {});
  System(const System&) = delete;
  System& operator=(const System&) = delete;
  const Units& units() const { return units_; }

  int size() const { return size_; }
  int rows() const { return rows_.count(); }
  int moving() const { return bodies_.count(); }
  /// 1 where a component has a rate, 0 where it is algebraic.
  Eigen::VectorXd id() const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(size_);
    out.head(first_multiplier()).setOnes();
    return out;
  }
  // Multipliers follow the state; where rows depend on each other they are known to round-off / eps
  // only, and at a singular position they have a pole. Newton's test is left to the state.
  Eigen::VectorXd absolute_tolerances(double tolerance) const {
    Eigen::VectorXd out = Eigen::VectorXd::Constant(size_, 1e10 * tolerance);
    out.head(first_multiplier()).setConstant(tolerance);
    return out;
  }

  /// y and y' at t = 0 from the scene.
  Eigen::VectorXd start_state() const {
    Eigen::VectorXd y = Eigen::VectorXd::Zero(size_);
    std::copy(bodies_.start().begin(), bodies_.start().end(), y.data());
    return y;
  }
  /// y' and the multipliers from the rest of y.
  void complete(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp);
  /// The values of the invariants that are kept are those of this state from now on.
  void keep_invariants_of(double t, const Eigen::VectorXd& y) {
    update(t, y.data());
    invariants_.keep(t, y.data());
  }
  std::vector<double>& kept() { return invariants_.kept(); }

  void residual(double t, const double* y, const double* yp, double* r, Stopwatch* watch);
  /// Adds dF/dy + cj dF/dy'.
  void jacobian(double t, double cj, const double* y, const double* yp, Entries& entries);

  ida_projection::Constraints constraints() {
    return in_use_.in_place() ? sparse_constraints() : dense_constraints();
  }
  /// Chooses the rows of the joints that are used from here on, see rows_in_use.cpp.
  void choose_rows(double t, const double* y, double tolerance) {
    update(t, y);
    in_use_.choose(tolerance);
  }
  /// After a step. True: constraints() give other rows from here on.
  void choose_rows_after_step() { in_use_.choose_after_step(); }
  double weakest_pivot() const { return in_use_.weakest_pivot(); }
  /// At a state near a singular position: joints whose rows depend on each other there. Empty
  /// elsewhere.
  std::vector<std::string> dependent_joints(double t, const double* y);
  int multiplier_choices() const { return in_use_.multiplier_choices(); }
  int constraint_count() const { return 2 * in_use_.count() + moving() + invariants_.count(); }
  void constraint_values(double t, const double* y, double* g) {
    row_values(t, y, g);
    if (invariants_.count() > 0) invariants_.values(t, y, g + first_invariant());
  }
  void constraint_jacobian(double t, const double* y, ConstraintRows C);
  std::vector<std::string> constraint_names() const;
  /// Position and velocity of every row of the joints, 2 rows().
  void joint_values(double t, const double* y, double* g) {
    update(t, y);
    rows_.values<0>(bodies_.all(), g);
    rows_.values<1>(bodies_.all(), g + rows());
  }
  std::string joint_of_row(int row) const { return rows_.joint_of(row); }

  void bodies(const double* y, std::vector<BodyState>& out) const { bodies_.read(y, out); }
  /// The first time after t at which forces have a kink or jump; infinite: there is none.
  double next_kink(double t) const { return effects::next_kink(kinks_, t); }
  /// drift in SI, the rest in units()
  Diagnostics diagnostics(double t, const double* y) {
    Diagnostics d;
    d.drift = drift(t, y);
    for (const auto& force : forces_) d.potential_energy += force->potential(bodies_.all());
    d.kinetic_energy = invariants_.energy() - d.potential_energy;
    d.momentum = bodies_.momentum();
    d.angular_momentum = bodies_.angular_momentum();
    return d;
  }
  /// In units().
  scene::Forces forces(double t, const double* y, const joints::Reactions& reactions);
  std::vector<std::string> effect_names() const {
    std::vector<std::string> names;
    for (const auto& force : forces_) names.emplace_back(force->name());
    names.emplace_back("joints");
    names.emplace_back("equations of motion");
    return names;
  }

 private:
  int first_work() const { return kBody * moving(); }
  int first_multiplier() const { return first_work() + (invariants_.has_work() ? 1 : 0); }

  int first_invariant() const { return 2 * in_use_.count() + moving(); }  // of the constraints
  void row_values(double t, const double* y, double* g);
  template <class Place>
  void row_jacobian(double t, const double* y, const Place& entries);
  ida_projection::SparseJacobian sparse_row_jacobian();
  ida_projection::Constraints dense_constraints(), sparse_constraints();

  /// frames, without accelerations
  void update(double t, const double* y) {
    rows_.set_time(t);
    bodies_.set_time(t);
    bodies_.set_state(y);
  }
  void add_multipliers(const double* lambda);
  void sum_forces(Stopwatch* watch) {
    clear(loads_);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      forces_[i]->add(bodies_.all(), loads_);
      if (watch) watch->lap(i);
    }
  }
  void torques_to_body_axes() {
    for (int k = 0; k < moving(); ++k) {
      Load6& load = loads_[at(k)];
      load.torque_body += bodies_.frame(k).R.transpose() * load.torque_world;
    }
  }
  void add_motion_residual(const double* y, const double* yp, double* r) const;
  void add_row_residual(const double* y, const double* yp, double* r) {
    const double* lambda = y + first_multiplier();
    double* out = r + first_multiplier();
    bodies_.set_accelerations(yp);
    rows_.values<2>(bodies_.all(), out);
    // In the place of a row that depends on others: its multiplier is 0.
    for (int i = 0; i < rows(); ++i)
      if (!in_use_.carries_multiplier(i)) out[i] = dynamics_.size_of_row()[i] * lambda[i];
  }
  void index0_jacobian(double cj, const double* y, Entries& entries);
  double power(const double* lambda) const;
  double drift(double t, const double* y);

  Formulation form_;
  Units units_;
  MovingBodies bodies_;
  JointRows rows_;
  Forces forces_;
  RowsInUse in_use_;  // moves the bodies, where they are at t = 0 until then
  KeptInvariants invariants_;
  ForwardDynamics dynamics_;
  JacobianTerms terms_;
  std::unique_ptr<AccelerationJacobian> acceleration_jacobian_;  // index 0
  std::vector<double> kinks_;                                    // of forces, by time
  int size_ = 0;
  std::vector<Load6> loads_;      // sums of forces on each moving body
  Eigen::VectorXd joint_values_;  // workspace
};

}  // namespace tether::scene::smooth
