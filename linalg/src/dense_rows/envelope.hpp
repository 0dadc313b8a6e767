// Tether: Cholesky factors by the envelope. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace tether::linalg {

/// G = L L^T, of each row the entries from the first one that can be filled up to the diagonal: L
/// fills no other ones (George and Liu, Computer Solution of Large Sparse Positive Definite
/// Systems, chapter 4). resize() allocates, nothing else does.
class Envelope {
 public:
  void resize(int most);

  void begin() { size_ = 0; }
  /// The next row's first column.
  void add_row(int first);
  int size() const { return size_; }

  /// The lower triangle of G is zero, to be filled by add() with column <= row, inside the
  /// envelope.
  void clear();
  void add(int row, int column, double entry) { row_at(row)[column] += entry; }
  /// G to L. False: not positive definite.
  bool factor();
  double diagonal(int k) const { return row_at(k)[k]; }
  /// x <- G^-1 x.
  void solve(double* x) const;

 private:
  const double* row_at(int k) const { return L_.data() + rows_[static_cast<std::size_t>(k)]; }
  double* row_at(int k) { return L_.data() + rows_[static_cast<std::size_t>(k)]; }

  int size_ = 0;
  std::ptrdiff_t entries_ = 0;
  std::vector<int> firsts_;
  std::vector<std::ptrdiff_t> rows_;  // where column 0 of each row would be
  std::vector<double> L_, inverse_;   // row by row; 1 / L_kk
};

}  // namespace tether::linalg
