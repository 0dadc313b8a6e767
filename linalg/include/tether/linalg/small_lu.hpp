// Tether: LU factors of small dense matrices. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// P A = L U of a square matrix with partial pivoting, right-looking [Golub, Van Loan, algorithm
/// 3.4.1], written over A. Column-major, n <= kLargest, no allocation.
///
/// Pivots and every rounding are those of LAPACK-style column elimination with 1/pivot as factor of
/// the multipliers and a division for each unknown of U x = y. That is what SUNDIALS' denseGETRF
/// and denseGETRS do, so that factors and solutions have their bits.
class SmallLU {
 public:
  static constexpr int kLargest = 64;  ///< most rows

  /// `a`: n columns of n entries each, replaced by U and, below the diagonal, L without its ones.
  /// Returns 0, or k + 1 where every candidate for the k-th pivot is 0; then only k columns are
  /// done. 0 < n <= kLargest is the caller's to see to.
  int factor(double* a, int n);

  /// A x = b with the factors that the last factor() left in `a`. x may be b.
  void solve(const double* a, const double* b, double* x) const { solve_(*this, a, b, x); }

  int size() const { return n_; }  ///< rows of the last factor()
  /// Row of A that became row k of P A.
  int row(int k) const { return row_[k]; }

 private:
  template <int Size>
  static void solve_sized(const SmallLU& self, const double* a, const double* b, double* x);
  static void solve_any(const SmallLU& self, const double* a, const double* b, double* x);
  using Solve = void (*)(const SmallLU&, const double*, const double*, double*);
  static Solve solve_for(int n);

  int n_ = 0;
  int row_[kLargest] = {};
  Solve solve_ = nullptr;
};

}  // namespace tether::linalg
TETHER_EXPORT_END
