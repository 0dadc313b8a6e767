// Tether: M y' = f(t, y) out of F(t, y, y') = 0, for codes that want it so.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>
#include <string>
#include <vector>

namespace tether::bench {

/// F = M y' - f with a constant M: every column is F(t, y, e_j) - F(t, y, 0), compared at the start
/// and at two other points.
class ExplicitForm {
 public:
  explicit ExplicitForm(const problems::Problem& problem);

  bool constant() const { return constant_; }
  /// M is diagonal without zeros: y' = f / M is an ordinary differential equation.
  bool ordinary() const { return constant_ && ordinary_; }
  const std::vector<double>& mass() const { return mass_; }  ///< column-major

  /// f = -F(t, y, 0), divided by M's diagonal if `solved`.
  void evaluate(double t, const double* y, double* f, bool solved) const;

 private:
  const problems::Problem& problem_;
  std::vector<double> mass_, zero_;
  bool constant_ = true, ordinary_ = true;
};

}  // namespace tether::bench
