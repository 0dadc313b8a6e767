// Tether: A A^T + eps I for many sparse rows and a few full ones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "gram_factor.hpp"

namespace tether::linalg {

/// Factors of
///
///     [ A A^T + eps I      A F^T      ]
///     [      F A^T     F F^T + eps I  ]
///
/// with the sparse rows A first and the full rows F last, since a full row makes A A^T full. The
/// factors are those of A A^T + eps I and the L diag(d) L^T of the Schur complement
/// F F^T + eps I - F A^T (A A^T + eps I)^-1 A F^T. Vectors z have the sparse rows' entries first.
/// Functions are those of GramFactor.
class BorderedGram {
 public:
  void analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns, int full);

  /// To be written before factor(): A f for full row f, and f . e for e <= f, which factor()
  /// overwrites.
  double* coupling(int f) {
    return B_.data() + static_cast<std::size_t>(f) * static_cast<std::size_t>(m_);
  }
  double& product(int f, int e) {
    return S_[static_cast<std::size_t>(f) * static_cast<std::size_t>(full_) +
              static_cast<std::size_t>(e)];
  }

  double eps() const { return eps_; }
  int factor(const double* A, const double* norm, double eps, double thin);
  /// Solves z <- M^-1 z. Returns |z| before the part of the full rows is subtracted, or 0 without
  /// full rows: the rounding of M z is proportional to that length and to |z|.
  double solve(double* z);
  void forward(double* z);
  void depend(double* z, int last);
  bool dependent(int i) const {
    return i < m_ ? sparse_.dependent(i) : dependent_[static_cast<std::size_t>(i - m_)] != 0;
  }
  double independent_part(int i) const;

 private:
  int factor_border(const double* norm, double eps);
  void forward_border(double* z, int count);
  double* solved(int f) {
    return Y_.data() + static_cast<std::size_t>(f) * static_cast<std::size_t>(m_);
  }
  double dot(const double* y, const double* z) const;
  void subtract(const double* y, double share, double* z) const;

  GramFactor sparse_;
  double eps_ = 0.0;
  int m_ = 0, full_ = 0;
  std::vector<double> B_, Y_;  // A f and (A A^T + eps I)^-1 A f, m entries for each full row
  std::vector<double> S_, d_;  // full x full, row-major: L below the diagonal
  std::vector<char> dependent_;
};

}  // namespace tether::linalg
