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
/// with the sparse rows A first and the full rows F last, which would fill A A^T: L diag(d) L^T of
/// their Schur complement F F^T + eps I - F A^T (A A^T + eps I)^-1 A F^T stands beside the sparse
/// factors. Vectors z have the sparse rows' entries first. Otherwise as GramFactor.
class BorderedGram {
 public:
  void analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns, int full);

  /// Writable before factor(): A f for full row f; f . e for e <= f, which factor() overwrites.
  double* coupling(int f) {
    return B_.data() + static_cast<std::size_t>(f) * static_cast<std::size_t>(m_);
  }
  double& product(int f, int e) {
    return S_[static_cast<std::size_t>(f) * static_cast<std::size_t>(full_) +
              static_cast<std::size_t>(e)];
  }

  double eps() const { return eps_; }
  int factor(const double* A, const double* norm, double eps, double thin);
  /// z <- M^-1 z; returns |z| before the full rows' part was taken off it, 0 where there are none:
  /// rounding of M z goes with that and with |z|.
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
