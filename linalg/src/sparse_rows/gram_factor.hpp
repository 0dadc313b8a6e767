// Tether: L diag(d) L^T of A A^T + eps I for sparse A. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace tether::linalg {

/// A A^T + eps I = P^T L diag(d) L^T P, L unit lower triangular, for rows A of unit length (or
/// zero) with a fixed pattern. The pattern of L is found once. With w = L^-1 P b,
///
///     d_k = eps + min_c |a_k - A_before^T c|^2 + eps |c|^2 ,   w_k = b_k - c . b_before ,
///
/// where c are the coefficients of row k over the rows before it. So d_k tells whether row k
/// depends on these rows, and w_k whether b_k agrees with the same combination of their values.
class GramFactor {
 public:
  /// Finds order and pattern of L for rows of n columns in compressed form.
  void analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns);

  /// Factors from the entries of A; norm[i] is 0 where row i is zero. A row counts as dependent if
  /// it is zero, or if d_k <= 16 eps (1 + |c|^2), which is tested where d_k <= max(thin, 1e6 eps).
  /// Dependent rows stay in the factors. Returns their number.
  int factor(const double* A, const double* norm, double eps, double thin);

  /// Solves z <- (A A^T + eps I)^-1 z.
  void solve(double* z);
  /// Computes z <- P^T L^-1 P z.
  void forward(double* z);
  /// Turns z = A a, rows() entries, into the coefficients of a over the independent rows that come
  /// before row `last` in the order, or over all independent rows if `last` is -1.
  void depend(double* z, int last) const;

  bool dependent(int i) const { return dependent_[static_cast<std::size_t>(place_of(i))] != 0; }
  /// Returns sqrt(d_k - eps) for row i, the k-th of the order.
  double independent_part(int i) const;
  int rows() const { return m_; }

 private:
  int place_of(int i) const { return place_[static_cast<std::size_t>(i)]; }
  void find_gram(const std::vector<int>& starts, const std::vector<int>& columns,
                 std::vector<int>& gram_starts, std::vector<int>& gram_rows) const;
  void list_columns(const std::vector<int>& starts, const std::vector<int>& columns);
  void find_supernodes();
  double eliminate(int k, double d);
  double coefficients_square(int k);
  int resolve_uncertain();
  void scatter_products(int k, const double* A);
  void forward_in_place();
  void back_in_place();

  // P A by rows (the index of each entry in A, and its column) and by columns (ascending rows of
  // P A, and the values of those that factor() has reached).
  struct PermutedRows {
    std::vector<int> starts, entry, column;
    std::vector<int> member_starts, member, met;
    std::vector<double> value;
  };
  // L by rows (ascending columns) and by columns (ascending rows, and the values).
  struct Triangle {
    std::vector<int> row_starts, row_columns, column_starts, column_rows, filled;
    std::vector<int> alike;  // columns from j on that have the rows of column j below them
    std::vector<double> value;
  };

  int m_ = 0, n_ = 0;
  std::vector<int> place_, row_at_;  // row i of A is row place_[i] of P A, and back
  PermutedRows PA_;
  Triangle L_;
  double eps_ = 0.0;
  std::vector<double> inverse_d_, work_, solution_;
  std::vector<char> dependent_;
  std::vector<int> uncertain_;  // rows of P A
  std::vector<double> square_;  // of their coefficients
};

}  // namespace tether::linalg
