// Tether: L diag(d) L^T of A A^T for sparse A. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace tether::linalg {

/// A A^T = P^T L diag(d) L^T P, L unit lower triangular, for rows A of unit length (or zero) with a
/// fixed pattern. The pattern of L and the products that make each entry of A A^T are found once.
class GramFactor {
 public:
  /// Rows in compressed form, n columns.
  void analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns);

  /// From the entries of A; norm[i] is 0 where row i is zero. A row with d_k <= `smallest` depends
  /// on those before it, or is zero: it is left out, as if it were not there (1/d_k = 0). Returns
  /// the number of such rows.
  int factor(const double* A, const double* norm, double smallest);

  /// z <- (A A^T)^-1 z over the kept rows; 0 for the others.
  void solve(double* z);
  bool kept(int i) const {
    return inverse_d_[static_cast<std::size_t>(place_[static_cast<std::size_t>(i)])] != 0.0;
  }
  int rows() const { return m_; }

 private:
  struct Product {
    int a, b;  // entries of A
  };
  void find_products(const std::vector<std::vector<int>>& in_column, const std::vector<int>& row);
  void find_factor_pattern();

  int m_ = 0;
  std::vector<int> place_, row_at_;  // row i of A is row place_[i] of P A, and back
  // Strict lower part of P A A^T P^T by rows, and each entry's products.
  std::vector<int> gram_starts_, gram_columns_, product_starts_;
  std::vector<Product> products_;
  // L by rows (which columns, ascending) and by columns (which rows, ascending, and the values).
  std::vector<int> row_starts_, row_columns_, column_starts_, column_rows_, filled_;
  std::vector<double> L_, inverse_d_, work_, solution_;
};

}  // namespace tether::linalg
