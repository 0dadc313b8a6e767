// Tether: derivatives of forces and rows of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>

#include "dimensions.hpp"
#include "joints/joint_rows.hpp"
#include "mechanics/force.hpp"
#include "smooth/rows/moving_bodies.hpp"
#include "smooth/rows/rows_in_use.hpp"

namespace tether::scene::smooth {

using Forces = std::vector<std::unique_ptr<Force>>;
/// A Jacobian of constraints, in the storage of the projection.
using ConstraintRows =
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

/// Values at the state that is set, minus those at the start. Work of forces without potential is
/// an unknown: energy minus work is kept.
class KeptInvariants {
 public:
  /// `work` is the index of the unknown in y, where there is one. Throws std::invalid_argument,
  /// naming what changes an invariant from outside.
  KeptInvariants(const Scene& scene, const MovingBodies& bodies, const Forces& forces, int work);

  int count() const { return static_cast<int>(rows_.size()); }
  bool has_work() const { return work_ >= 0; }
  /// Values at the start, to save and to set.
  std::vector<double>& kept() { return kept_; }
  /// Keeps those of the state that is set from now on.
  void keep(double t, const double* y) {
    std::fill(kept_.begin(), kept_.end(), 0.0);
    if (kept_.empty()) return;
    std::vector<double> now(kept_.size());
    values(t, y, now.data());
    kept_ = now;
  }

  double energy() const {
    double sum = bodies_.kinetic_energy();
    for (const auto& force : forces_) sum += force->potential(bodies_.all());
    return sum;
  }
  void values(double t, const double* y, double* g) const;
  void jacobian(ConstraintRows C, int row) const {
    for (const Row& each : rows_) put_gradient(each, C.row(row++));
  }
  void add_names(std::vector<std::string>& names) const {
    for (const Row& each : rows_)
      names.emplace_back(each.kind == InvariantKind::energy     ? "energy"
                         : each.kind == InvariantKind::momentum ? "momentum"
                                                                : "angular momentum");
  }
  /// Unit of each value in SI.
  std::vector<double> units(const Units& units) const {
    std::vector<double> all;
    for (const Row& each : rows_)
      all.push_back(each.kind == InvariantKind::energy     ? units.energy()
                    : each.kind == InvariantKind::momentum ? units.momentum()
                                                           : units.angular_momentum());
    return all;
  }

 private:
  /// Energy less work, or a component of momentum or of angular momentum about the origin.
  struct Row {
    InvariantKind kind;
    Vector3d along;
  };
  void put_gradient(const Row& of, Eigen::Ref<Eigen::RowVectorXd> row) const;

  const MovingBodies& bodies_;
  const Forces& forces_;
  int work_ = -1;
  std::vector<Row> rows_;
  Vector3d steady_force_;  // momentum grows by it
  std::vector<double> kept_;
};

/// M a = f + G^T lambda and G a = -gamma. Few rows: dense, with a diagonal term of 1e-11 in
/// G M^-1 G^T, refined three times, so that it decides only where the rows do not. Many: by the
/// entries of G; gradient() and solve_rows() are then not to be had.
class ForwardDynamics {
 public:
  /// Sets the state at the start of the scene. `gradient`: it will be asked for.
  ForwardDynamics(JointRows& rows, MovingBodies& bodies, bool gradient);

  /// At the state that is set; torques in body axes. Leaves the accelerations of the frames at 0.
  void solve(const std::vector<Load6>& loads);
  /// Puts the accelerations into the frames.
  void set_accelerations() {
    for (int k = 0; k < bodies_.count(); ++k) {
      Frame<double>& f = bodies_.frame(k);
      f.a = a_.segment<3>(6 * k);
      f.alpha = f.R * a_.segment<3>(6 * k + 3);
    }
  }

  const Eigen::VectorXd& multipliers() const { return lambda_; }
  const Eigen::VectorXd& accelerations() const { return a_; }
  const JointGradient& gradient() const { return gradient_; }
  /// Diagonal of G M^-1 G^T at the start.
  const Eigen::VectorXd& size_of_row() const { return size_of_row_; }
  /// dlambda of a right side, by the factors of the last solve().
  Eigen::MatrixXd solve_rows(const Eigen::MatrixXd& right) const { return factor_.solve(right); }

 private:
  void solve_dense();
  void solve_sparse() {
    sparse_->factor();
    sparse_->multiply(free_, right_);
    right_ = -gamma_ - right_;
    sparse_->solve(right_, change_, lambda_);
    a_ += change_;
  }

  const JointRows& rows_;
  MovingBodies& bodies_;
  std::optional<SparseJointGradient> sparse_;
  JointGradient gradient_;
  Eigen::VectorXd size_of_row_, epsilon_, lambda_, a_;
  Eigen::VectorXd gamma_, free_, right_, scratch_, change_;
  Eigen::MatrixXd regular_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

/// Terms of a Jacobian at the state that is set.
struct JacobianTerms {
  const MovingBodies& bodies;
  const JointRows& rows;
  const Forces& forces;

  /// Minus the derivatives of the forces and of G^T lambda to y and, from the column
  /// `first_lambda` on, to lambda (< 0: none).
  void add_motion(JacobianBlocks& J, const double* lambda, int first_lambda) const;
  /// Derivatives of g'' to y and, where `in_use` is given, times cj to the accelerations; rows
  /// without a multiplier are 0 then.
  void add_rows(JacobianBlocks& J, int first_row, const RowsInUse* in_use, double cj) const;
  /// Minus the derivatives of the power of all forces, by multipliers apart.
  void add_power(JacobianBlocks& J) const {
    for (const auto& force : forces)
      if (force->has_power()) force->add_power_jacobian(bodies.all(), J);
  }
};

/// With D = -d(f + G^T lambda)/dy and A = dg''/dy at fixed a and lambda:
/// M da = G^T dlambda - D dy, G da = -A dy.
class AccelerationJacobian {
 public:
  AccelerationJacobian(const JacobianTerms& terms, const ForwardDynamics& dynamics)
      : terms_(terms), dynamics_(dynamics) {
    const int n = 6 * terms.bodies.count();
    left_.setZero(n + terms.rows.count(), kBody * terms.bodies.count());
  }

  /// At the state that is set, with its multipliers, accelerations and turns.
  void form();
  const Eigen::MatrixXd& accelerations() const { return da_; }     ///< 6 a body x its unknowns
  const Eigen::MatrixXd& multipliers() const { return dlambda_; }  ///< of each row

 private:
  void form_left();

  const JacobianTerms& terms_;
  const ForwardDynamics& dynamics_;
  Eigen::MatrixXd left_, da_, dlambda_;
  Entries entries_;
};

}  // namespace tether::scene::smooth
