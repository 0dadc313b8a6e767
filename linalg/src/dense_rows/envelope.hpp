// Tether: Cholesky factors by the envelope. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace tether::linalg {

/// G = L L^T, of each row the entries from the first one that can be filled up to the diagonal: L
/// fills no other ones (George and Liu, Computer Solution of Large Sparse Positive Definite
/// Systems, chapter 4). Four rows and four columns are one block. resize() allocates, nothing else
/// does.
class Envelope {
 public:
  static constexpr int kStride = 4;  ///< from one column of a row to the next

  void resize(int most);

  void begin() { size_ = 0; }
  /// The next row's first column.
  void add_row(int first);
  /// After the last one.
  void plan();
  int size() const { return size_; }

  /// The lower triangle of G is zero, to be filled in row(k)[kStride column], inside the envelope.
  void clear();
  double* row(int k) { return L_.data() + starts_[static_cast<std::size_t>(k / 4)] + k % 4; }
  /// G to L. False: not positive definite. least > 0: rows whose diagonal entry, less what the rows
  /// before explain of it, is no larger are left out: x_k = 0 in solve(), and diagonal(k) = 0.
  bool factor(double least = 0.0);
  double diagonal(int k) const { return diagonal_[static_cast<std::size_t>(k)]; }
  /// x <- G^-1 x; x has room for three entries more.
  void solve(double* x) const;

 private:
  int count() const { return (size_ + 3) / 4; }

  int size_ = 0;
  std::ptrdiff_t entries_ = 0;
  // For each four rows: their first columns, and where a full row would begin in L_.
  std::vector<int> firsts_;
  std::vector<std::ptrdiff_t> starts_;
  std::vector<double> L_;  // four rows after the other, each column by column
  std::vector<double> diagonal_, inverse_;
};

}  // namespace tether::linalg
