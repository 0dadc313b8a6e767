// Tether: A A^T + eps I for many sparse rows and a few full ones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>
#include <vector>

#include "gram_factor.hpp"

namespace tether::linalg {

constexpr double kDependentBorder = 10.0;  // eps, as in GramFactor

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
  void analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns, int full) {
    sparse_.analyse(n, starts, columns);
    m_ = sparse_.rows();
    full_ = full;
    B_.assign(at(full) * at(m_), 0.0);
    Y_.assign(B_.size(), 0.0);
    S_.assign(at(full) * at(full), 0.0);
    d_.assign(at(full), 1.0);
    dependent_.assign(at(full), 0);
  }

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
  int factor(const double* A, const double* norm, double eps, double thin) {
    eps_ = eps;
    int count = sparse_.factor(A, norm, eps, thin);
    for (int f = 0; f < full_; ++f) {
      std::copy(coupling(f), coupling(f) + m_, solved(f));
      sparse_.solve(solved(f));
      for (int e = 0; e <= f; ++e) product(f, e) -= dot(solved(f), coupling(e));
    }
    for (int f = 0; f < full_; ++f) {
      double d = product(f, f) + eps;
      for (int e = 0; e < f; ++e) {
        double y = product(f, e);
        for (int k = 0; k < e; ++k) y -= product(e, k) * product(f, k) * d_[at(k)];
        product(f, e) = y / d_[at(e)];
        d -= y * product(f, e);
      }
      const bool vanished = !(norm[m_ + f] > 0.0);
      d_[at(f)] = vanished ? 1.0 : std::max(d, eps);
      dependent_[at(f)] = vanished || !(d > kDependentBorder * eps);
      count += dependent_[at(f)];
    }
    return count;
  }
  /// Solves z <- M^-1 z. Returns |z| before the part of the full rows is subtracted, or 0 without
  /// full rows: the rounding of M z is proportional to that length and to |z|.
  double solve(double* z) {
    double* border = z + m_;
    forward_border(z, full_);
    sparse_.solve(z);
    const double before = full_ > 0 ? dot(z, z) : 0.0;
    for (int f = full_ - 1; f >= 0; --f) {
      border[f] /= d_[at(f)];
      for (int e = f + 1; e < full_; ++e) border[f] -= product(e, f) * border[e];
      subtract(solved(f), border[f], z);
    }
    return std::sqrt(before);
  }
  void forward(double* z) {
    forward_border(z, full_);
    sparse_.forward(z);
  }
  void depend(double* z, int last) {
    double* border = z + m_;
    const int count = last < 0 ? full_ : std::max(0, last - m_);
    forward_border(z, count);
    std::fill(border + count, border + full_, 0.0);
    for (int f = count - 1; f >= 0; --f) {
      border[f] /= d_[at(f)];
      for (int e = f + 1; e < count; ++e) border[f] -= product(e, f) * border[e];
      if (dependent_[at(f)]) border[f] = 0.0;
      subtract(coupling(f), border[f], z);
    }
    sparse_.depend(z, last < m_ ? last : -1);
  }
  bool dependent(int i) const {
    return i < m_ ? sparse_.dependent(i) : dependent_[static_cast<std::size_t>(i - m_)] != 0;
  }
  double independent_part(int i) const {
    return i < m_ ? sparse_.independent_part(i) : std::sqrt(std::max(0.0, d_[at(i - m_)] - eps_));
  }

 private:
  // Computes the entries of L^-1 z that belong to the first `count` full rows.
  void forward_border(double* z, int count) {
    double* border = z + m_;
    for (int f = 0; f < count; ++f) {
      border[f] -= dot(solved(f), z);
      for (int e = 0; e < f; ++e) border[f] -= product(f, e) * border[e];
    }
  }
  double* solved(int f) {
    return Y_.data() + static_cast<std::size_t>(f) * static_cast<std::size_t>(m_);
  }
  double dot(const double* y, const double* z) const {
    double sum = 0.0;
    for (int i = 0; i < m_; ++i) sum += y[i] * z[i];
    return sum;
  }
  void subtract(const double* y, double share, double* z) const {
    for (int i = 0; i < m_; ++i) z[i] -= share * y[i];
  }

  GramFactor sparse_;
  double eps_ = 0.0;
  int m_ = 0, full_ = 0;
  std::vector<double> B_, Y_;  // A f and (A A^T + eps I)^-1 A f, m entries for each full row
  std::vector<double> S_, d_;  // full x full, row-major: L below the diagonal
  std::vector<char> dependent_;
};

}  // namespace tether::linalg
