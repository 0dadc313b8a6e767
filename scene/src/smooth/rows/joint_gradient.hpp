// Tether: the gradient of the rows of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/sparse_minimum_norm.hpp>

#include "joints/joint_rows.hpp"
#include "moving_bodies.hpp"

namespace tether::scene::smooth {

using joints::JointRows;

/// G (rows x 6 velocities of each moving body, angular ones in body axes), G M^-1 and G M^-1 G^T.
struct JointGradient {
  Eigen::MatrixXd G, GM, S;

  void form(const JointRows& rows, const MovingBodies& bodies);
};

using joints::JointRows;

/// C = G M^-1/2 with G as in JointGradient, by its entries: six for each row and body.
class SparseJointGradient {
 public:
  SparseJointGradient(const JointRows& rows, const MovingBodies& bodies);

  /// At the state that is set. Rows that are not wanted count as zero; `dependent`: how short what
  /// others leave of a row of unit length, in the metric of M, is if it is to depend on them.
  void factor();
  void factor(const std::vector<char>& wanted, double dependent);
  /// After factor(): 1 for each row that is wanted and depends on none of the others; their number.
  int independent(std::vector<char>& rows) const;
  /// After factor(): what rows before row i in the order of elimination leave of it, 0 to 1.
  double independent_part(int i) const { return factors_.independent_part(i); }
  /// After factor(): a row that depends on others, and those that matter in it; none: empty.
  std::vector<int> dependent() const;
  /// Finds a with G a = right of least kinetic energy a^T M a / 2, and lambda with M a = G^T
  /// lambda.
  void solve(const Eigen::VectorXd& right, Eigen::VectorXd& a, Eigen::VectorXd& lambda);
  /// Takes from velocities v what the factored rows forbid.
  void release(Eigen::VectorXd& v);
  /// Product of G with each moving body's velocities.
  void multiply(const Eigen::VectorXd& a, Eigen::VectorXd& rates) const;
  /// Diagonal of G M^-1 G^T; after factor().
  Eigen::VectorXd size_of_rows() const;

 private:
  void factor(const char* wanted, double rank_tolerance);
  void add_least(double share, Eigen::VectorXd& a) const;  // share times the last solution
  template <class Put>
  void each_entry(const Put& put) const;

  const JointRows& rows_;
  const MovingBodies& bodies_;
  std::vector<Eigen::Matrix3d> roots_;  // L of each moving body's inverse inertia L L^T
  std::vector<int> starts_;
  linalg::SparseMinimumNorm factors_;
  Eigen::VectorXd least_, rates_;
};

}  // namespace tether::scene::smooth
