// Tether: derivatives of forces and rows of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

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

}  // namespace tether::scene::smooth
