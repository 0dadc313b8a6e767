// Tether: minimum-norm solution of C dy = g for many sparse rows and a few full ones.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

namespace tether::linalg {

class GramFactor;

/// The same as MinimumNorm, min sum_j (dy_j / D_j)^2 subject to C dy = g, for an m x n matrix C
/// whose first rows are sparse with a fixed pattern and whose last `full` rows are dense:
///
/// With A = S C D, S = diag(1 / |row_i(C D)|), for the sparse rows alone du = A^T z, A A^T z = S g.
/// A A^T = L diag(d) L^T with L sparse (approximate minimum degree, analysed once). A full row a,
/// which would fill A A^T, is replaced by its part q = a - A^T (A A^T)^-1 A a that leaves the
/// sparse rows alone, and du follows along q. dy = D du.
///
/// Condition: A A^T squares that of A. Rows have unit length, so d_k is the squared sine of the
/// angle between row k and those before it; a row with a sine of `rank_tolerance` or less is
/// dropped, and 1e-6 is what round-off allows. There is no pivoting for rank: dropped are rows that
/// depend on earlier ones in the elimination's order. A move is exact up to about eps /
/// rank_tolerance^2 at worst, which repeated moves (Newton's method) remove.
///
/// Cost: resize() sets up a list of products, sum_j (entries in column j)^2 long: a column that all
/// rows share makes that m^2. factor() and solve() do not allocate.
class SparseMinimumNorm {
 public:
  SparseMinimumNorm();
  ~SparseMinimumNorm();
  SparseMinimumNorm(SparseMinimumNorm&&) noexcept;
  SparseMinimumNorm& operator=(SparseMinimumNorm&&) noexcept;

  /// Sparse rows in compressed form: columns[starts[i] .. starts[i + 1]), ascending, of row i.
  void resize(int columns, std::vector<int> starts, std::vector<int> column_of, int full_rows);

  int rows() const { return sparse_ + full_; }
  int columns() const { return n_; }
  int sparse_rows() const { return sparse_; }

  /// Writable storage for the sparse rows of C, in the order of the pattern; factor() overwrites
  /// it.
  double* entries() { return A_.data(); }
  /// The same for full row k, n entries.
  double* full_row(int k) { return full_rows_.data() + static_cast<std::size_t>(k) * width(); }
  /// Writable storage for D, n entries >= 0, that the next factor() reads; D_j = 0 keeps dy_j = 0.
  double* metric() { return metric_.data(); }

  /// False if C D has an entry that is not finite; the factors are then unusable.
  bool factor(double rank_tolerance = 1e-6);
  /// dy (n entries) from the kept factors; g has m entries in the units of the rows.
  void solve(const double* g, double* dy);

  int rank() const { return rows() - dropped(); }
  int dropped() const { return static_cast<int>(dropped_.size()); }
  /// k < rank(): kept rows; k >= rank(): dropped ones.
  int pivot(int k) const { return order_[static_cast<std::size_t>(k)]; }
  /// |row_i(C D)|; 0 for a row that vanishes.
  double row_norm(int i) const { return norm_[static_cast<std::size_t>(i)]; }
  /// After solve(): |A_i du - (S g)_i| of the dropped row pivot(k); |g_i| if it vanishes.
  double inconsistency(int k) const { return inconsistency_[static_cast<std::size_t>(k - rank())]; }
  /// Coefficients over the kept rows pivot(0 .. rank()-1) that give dropped row k. Allocates.
  std::vector<double> dependence(int k) const;

 private:
  std::size_t width() const { return static_cast<std::size_t>(n_); }
  bool scale_sparse();
  bool scale_full();
  void orthogonalise();
  void take_out_sparse(double* row);
  double row_dot(int i, const double* u) const;
  void add_rows(const double* z, double sign, double* u) const;

  int n_ = 0, sparse_ = 0, full_ = 0;
  std::vector<int> starts_{0}, column_;
  std::vector<double> A_, metric_, norm_, inverse_norm_;
  std::vector<double> full_rows_, apart_;  // a, unit length, and q, unit length
  std::vector<double> along_;              // a . q; 0: the full row is dropped
  std::vector<double> du_, z_;
  std::unique_ptr<GramFactor> gram_;
  std::vector<int> dropped_, order_;
  std::vector<double> inconsistency_;
};

}  // namespace tether::linalg
