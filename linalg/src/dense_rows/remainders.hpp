// Tether: what independent rows leave of the others. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tether::linalg {

/// Remainders R of rows, orthogonal to all firm rows, which are factored by pivoted
/// orthogonalisation: P R = L Q. Only resize() allocates.
class Remainders {
 public:
  /// Reserves memory for at most so many; pages that stay unused are not touched.
  void resize(int rows, int columns);

  void begin() { count_ = rank_ = 0; }
  /// Returns where to write the remainder of row `row`, n entries.
  double* add(int row);
  /// Factors them; the rank counts those longer than `tolerance`. Afterwards row(k) is the k-th in
  /// pivot order.
  void factor(double tolerance);

  int count() const { return count_; }
  int rank() const { return rank_; }
  int row(int k) const { return rows_[static_cast<std::size_t>(k)]; }
  /// Returns L_kk for k < rank(); it is no larger than the one before.
  double independent_part(int k) const { return L_(k, k); }

  /// Computes w = L^-1 rest and du <- du + Q^T w for the first `rank` remainders. Overwrites
  /// `rest`.
  void add_solution(int rank, double* rest, double* du) const;
  /// Finds x with remainder k = sum_l x_l remainder l, l < rank, by least squares.
  void dependence(int k, int rank, double* x) const;

 private:
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  void take_out(int k, int from, int to);

  int count_ = 0, rank_ = 0;
  std::vector<int> rows_;
  Rows Q_;  // the remainders, later the orthogonal rows
  Eigen::MatrixXd L_;
};

}  // namespace tether::linalg
