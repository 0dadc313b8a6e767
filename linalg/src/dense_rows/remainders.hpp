// Tether: what independent rows leave of the others. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tether::linalg {

/// Rows that are orthogonal to all firm ones, made orthogonal to each other with pivoting:
/// P R = L Q. resize() allocates, nothing else does.
class Remainders {
 public:
  /// At most so many. Memory is touched by what is used of it.
  void resize(int rows, int columns);

  void begin() { count_ = rank_ = 0; }
  /// Room for the remainder of row `row`, n entries.
  double* add(int row);
  /// Those longer than `tolerance` count. Afterwards row(k) is the k-th in pivot order.
  void factor(double tolerance);

  int count() const { return count_; }
  int rank() const { return rank_; }
  int row(int k) const { return rows_[static_cast<std::size_t>(k)]; }
  /// L_kk, k < rank(): no larger than the one before.
  double independent_part(int k) const { return L_(k, k); }

  /// For the first `rank` remainders: w = L^-1 rest, du += Q^T w; rest is overwritten.
  void add_solution(int rank, double* rest, double* du) const;
  /// x with remainder k = sum_l x_l remainder l, l < rank, in the sense of least squares.
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
