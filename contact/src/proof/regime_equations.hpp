// Tether: Coulomb's law in fixed regimes as a square system. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "proof/island.hpp"

namespace tether::contact::detail {

/// F(x) = 0 for the contacts that touch, and its Jacobian J at x. Those that separate get x = 0.
///
///     sticking: w = 0
///     sliding:  w_n = 0,  c (x_t1 w_t2 - x_t2 w_t1) = 0,  c/2 (|x_t|^2 - mu^2 x_n^2) = 0
///
/// with c near 1 / |x_t|; in the plane x_t = +-mu x_n, without friction x_t = 0. F is quadratic.
class RegimeEquations {
 public:
  RegimeEquations(const ProofIsland& island, const std::vector<Regime>& regimes,
                  const Eigen::VectorXd& x);

  const Eigen::VectorXd& x() const { return x_; }
  Eigen::VectorXd middle() const;                  ///< of F
  Eigen::VectorXd radius() const;                  ///< of F
  const Eigen::MatrixXd& J() const { return J_; }  ///< rounded
  /// At least |F(x + e) - F(x) - J e| for every |e| <= rho, with J as rounded; spread >= |A| rho.
  Eigen::VectorXd remainder(const Eigen::VectorXd& rho, const Eigen::VectorXd& spread) const;
  /// Unknowns as a vector of all contacts, with zeros.
  Eigen::VectorXd scattered(const Eigen::VectorXd& unknowns) const;

 private:
  void slide(int row, int contact);

  const ProofIsland& island_;
  const std::vector<Regime>& regimes_;
  const Eigen::VectorXd x_;
  const Velocities velocities_;
  std::vector<int> touching_;
  std::vector<Interval> F_;
  Eigen::MatrixXd J_;
  Eigen::VectorXd c_;  // by contact
};

}  // namespace tether::contact::detail
