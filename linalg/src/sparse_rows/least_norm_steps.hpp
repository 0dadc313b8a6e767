// Tether: minimum-norm solutions and multipliers by repeated steps with regularised factors
// (method, eq. 20). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "bordered_gram.hpp"
#include "unit_rows.hpp"

namespace tether::linalg {

/// Finds du of least norm with A du = b by proximal steps du <- du + A^T M^-1 (b - A du),
/// M = A A^T + eps I, and by conjugate gradients where these become slow; see SparseMinimumNorm.
class LeastNormSteps {
 public:
  void resize(const UnitRows& rows);
  /// Takes b_i = g_i / |row_i(C D)| and stops at |b - A du| <= tolerance |b| + 4e-16 |du|.
  void solve(const UnitRows& rows, BorderedGram& gram, const double* g, double tolerance);

  /// Returns A^T M^-1 b, valid until the next call.
  const double* one(const UnitRows& rows, BorderedGram& gram, const double* g);

  const double* solution() const { return du_.data(); }
  /// The residual b - A du of the last solve().
  const std::vector<double>& left() const { return left_; }
  double residual() const { return residual_; }  ///< |b - A du| / |b|
  int iterations() const { return iterations_; }

 private:
  struct System {
    const UnitRows& rows;
    BorderedGram& gram;
  };
  double find_left(const System& system);
  double find_step(const System& system);
  bool first_step(const System& system, double* left);
  void remove_rest_with_kept_factors(const System& system, double share,
                                     const std::vector<double>& step, double* left);
  bool done(double step, double left) const;
  bool proximal_steps(const System& system, double* left);
  void gradient_steps(const System& system, double* left);

  std::vector<double> du_, b_, left_;  // left_ = b - A du
  std::vector<double> z_, step_;       // M^-1 (b - A du), and A^T of it
  std::vector<double> p_, Ap_, MAp_;   // conjugate gradients: direction, A p, M^-1 A p
  double size_ = 0.0, tolerance_ = 0.0, residual_ = 0.0;  // size_ = |b|
  int iterations_ = 0;
};

/// Finds x of least norm with A^T x = u.
class LeastMultipliers {
 public:
  void resize(const UnitRows& rows);
  /// Takes u = D^-1 dy; `eps` is that of the factors. Writes x for the rows of C, rows() entries.
  void find(const UnitRows& rows, BorderedGram& gram, double eps, const double* dy, double* x);

 private:
  void add(const UnitRows& rows, BorderedGram& gram, const double* dy, double* x);

  std::vector<double> step_, rest_, z_;  // A^T x, u - A^T x, M^-1 of A of it
};

}  // namespace tether::linalg
