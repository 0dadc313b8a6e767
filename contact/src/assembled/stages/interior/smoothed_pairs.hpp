// Tether: pairs on the smoothed complementarity of cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/stages/interior/equations.hpp"

namespace tether::contact::detail {

/// x and u with x o u = nu e exactly, from any z = x - rho u: x is the smoothed part of z in the
/// cone and rho u that of -z, eigenvalue by eigenvalue (l + sqrt(l^2 + 4 rho nu)) / 2. A step in z
/// meets no cone: where a contact slides, sticks or is open x and u follow z almost linearly
/// however small nu is, and z_t turns both (method, eq. 25).
class SmoothedPairs {
 public:
  struct Place {
    Packed z;
    double log_nu = 0;
  };

  SmoothedPairs(const System& system, const InteriorEquations& equations);

  /// Takes z from a pair.
  void take(const ConePair& pair, double nu);
  void set(ConePair& pair) const;
  double nu() const { return std::exp(at_.log_nu); }
  const Place& place() const { return at_; }
  void go_to(const Place& place) { at_ = place; }
  void move(const Packed& change, double length, double log_nu);

  /// dz of a change of x and u.
  void change_of(const ConePair& pair, Packed& out) const;
  /// Changes count by their parts of what they change: each eigenvalue by its distance from the
  /// kink between regimes, the direction of z_t by its angle.
  double inner(const Packed& a, const Packed& b) const;
  double largest(const Packed& change) const;

 private:
  struct Parts {
    double v[3];
  };
  Parts parts(int i, const double* change) const;

  const InteriorEquations& equations_;
  std::vector<double> rho_;
  Place at_;
};

}  // namespace tether::contact::detail
