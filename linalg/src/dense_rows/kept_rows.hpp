// Tether: unit rows that are known to be independent, and A A^T = L L^T of them.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tether::linalg {

/// Unit rows A = S C D, S = diag(1 / |row_i(C D)|), as lists of the entries that are not zero: rows
/// of mechanisms have few. `order` lists the independent ones first; of these A A^T is factored.
/// resize() allocates, nothing else does.
class KeptRows {
 public:
  void resize(int rows, int columns);

  /// A from C(i, j) = wide[rows[i] * width + columns[j]] and D; row_norm receives |row_i(C D)|.
  /// False: an entry is not finite.
  bool load(const double* wide, int width, const int* rows, const int* columns, const double* D,
            double* row_norm);
  /// A A^T = L L^T of the first `rank` rows of the order. False: not positive definite.
  bool factor(const int* order, int rank);
  /// L_kk: how much of row k of the order is independent of those before it.
  double independent_part(int k) const { return L_(k, k); }
  double least_part(int rank) const { return L_.diagonal().head(rank).minCoeff(); }

  /// du = A^T (A A^T)^-1 z over the first `rank` of these rows; z is overwritten.
  void solve(int rank, double* z, double* du) const;
  /// A_i . du.
  double times(int i, const double* du) const;
  /// x with A_i = sum_k x_k A_order(k), k < rank, in the sense of least squares.
  void dependence(int i, int rank, double* x) const;

 private:
  // Above this share of entries dense products are cheaper.
  static constexpr double kDense = 0.25;

  template <class Visit>
  void visit(int i, Visit f) const {
    const auto row = static_cast<std::size_t>(i);
    for (int e = starts_[row]; e < starts_[row + 1]; ++e)
      f(columns_[static_cast<std::size_t>(e)], entries_[static_cast<std::size_t>(e)]);
  }
  void spread(int i) const;
  void clear(int i) const;
  void solve_factored(int rank, double* z) const;
  void multiply_sparse(int rank);
  void multiply_dense(int rank);
  bool factor_sparse(int rank);

  int n_ = 0;
  const int* order_ = nullptr;  // the caller's
  std::vector<int> starts_, columns_;
  std::vector<double> entries_;
  struct Link {
    int next, row;
    double entry;
  };
  std::vector<int> heads_;  // of each column: its last entry so far in links_
  std::vector<Link> links_;
  mutable std::vector<double> work_;  // one row, spread out
  Eigen::MatrixXd L_, spread_;        // the lower triangle; the rows as columns
};

}  // namespace tether::linalg
