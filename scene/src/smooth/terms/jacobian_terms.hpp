// Tether: derivatives of forces and rows of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "forward_dynamics.hpp"
#include "joints/joint_rows.hpp"
#include "kept_invariants.hpp"
#include "smooth/rows/moving_bodies.hpp"
#include "smooth/rows/rows_in_use.hpp"

namespace tether::scene::smooth {

/// Terms of a Jacobian at the state that is set.
struct JacobianTerms {
  const MovingBodies& bodies;
  const JointRows& rows;
  const Forces& forces;

  /// Minus the derivatives of the forces and of G^T lambda to y and, from the column
  /// `first_lambda` on, to lambda (< 0: none).
  void add_motion(JacobianBlocks& J, const double* lambda, int first_lambda) const;
  /// Derivatives of the order-th rate of g to y and, times cj, to the accelerations; rows without a
  /// multiplier are 0 where `in_use` is given.
  template <int order>
  void add_rows(JacobianBlocks& J, int first_row, const RowsInUse* in_use, bool accelerations,
                double cj) const;
  /// Minus the derivatives of the power of all forces, by multipliers apart.
  void add_power(JacobianBlocks& J) const;
};

/// With D = -d(f + G^T lambda)/dy and A = dg''/dy at fixed a and lambda:
/// M da = G^T dlambda - D dy, G da = -A dy.
class AccelerationJacobian {
 public:
  AccelerationJacobian(const JacobianTerms& terms, const ForwardDynamics& dynamics);

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
  bool recorded_ = false;
};

}  // namespace tether::scene::smooth
