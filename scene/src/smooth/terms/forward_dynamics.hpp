// Tether: accelerations and multipliers of a state. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>

#include "smooth/rows/joint_gradient.hpp"

namespace tether::scene::smooth {

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
  void set_accelerations();

  const Eigen::VectorXd& multipliers() const { return lambda_; }
  const Eigen::VectorXd& accelerations() const { return a_; }
  const JointGradient& gradient() const { return gradient_; }
  /// Diagonal of G M^-1 G^T at the start.
  const Eigen::VectorXd& size_of_row() const { return size_of_row_; }
  /// dlambda of a right side, by the factors of the last solve().
  Eigen::MatrixXd solve_rows(const Eigen::MatrixXd& right) const { return factor_.solve(right); }

 private:
  void solve_dense();
  void solve_sparse();

  const JointRows& rows_;
  MovingBodies& bodies_;
  std::optional<SparseJointGradient> sparse_;
  JointGradient gradient_;
  Eigen::VectorXd size_of_row_, epsilon_, lambda_, a_;
  Eigen::VectorXd gamma_, free_, right_, scratch_, change_;
  Eigen::MatrixXd regular_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

}  // namespace tether::scene::smooth
