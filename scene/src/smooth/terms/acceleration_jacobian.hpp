// Tether: derivatives of the accelerations by the state, for index 0. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "forward_dynamics.hpp"
#include "jacobian_terms.hpp"

namespace tether::scene::smooth {

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
