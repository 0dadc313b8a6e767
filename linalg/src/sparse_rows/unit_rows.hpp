// Tether: the rows of C D at unit length, many of them sparse and a few full.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace tether::linalg {

class BorderedGram;

double dot(const double* a, const double* b, std::size_t n);

/// A = S C D, S = diag(1 / |row_i(C D)|), the sparse rows first; rows that vanish are zero.
class UnitRows {
 public:
  /// Takes the sparse rows in compressed form. Throws std::invalid_argument for an invalid pattern.
  void resize(int columns, std::vector<int> starts, std::vector<int> column_of, int full_rows);
  /// Prepares the factors for the pattern.
  void analyse(BorderedGram& gram) const;

  int rows() const { return sparse_ + full_; }
  int sparse_rows() const { return sparse_; }
  int columns() const { return n_; }
  std::size_t width() const { return static_cast<std::size_t>(n_); }

  /// C before scale(), A afterwards: the sparse rows' entries, and full row k.
  double* entries() { return A_.data(); }
  double* full_row(int k) { return full_rows_.data() + static_cast<std::size_t>(k) * width(); }
  double* metric() { return metric_.data(); }
  const double* metric() const { return metric_.data(); }

  /// Turns C into A. Returns false if an entry is not finite.
  bool scale();
  /// Factors A A^T + eps I and returns the number of dependent rows.
  int factor(BorderedGram& gram, double eps, double thin);
  /// |row_i(C D)| and its inverse, both 0 for a row that vanishes.
  double norm(std::size_t i) const { return norm_[i]; }
  double inverse_norm(std::size_t i) const { return inverse_norm_[i]; }

  /// Computes z = A u.
  void multiply(const double* u, double* z) const;
  /// Computes u = A^T z.
  void transposed(const double* z, double* u) const;
  /// Writes row i of A with all its entries.
  void spread(int i, std::vector<double>& row) const;

 private:
  /// The sparse rows' entries by columns: the row of each, its index in A_ and its value.
  struct Columns {
    std::vector<int> starts{0}, row, entry;
    std::vector<double> value;
  };
  void list_columns();
  bool scale_sparse();
  bool scale_full();
  double row_dot(int i, const double* u) const;

  int n_ = 0, sparse_ = 0, full_ = 0;
  std::vector<int> starts_{0}, column_;
  std::vector<double> A_, full_rows_, metric_, norm_, inverse_norm_;
  Columns by_column_;
};

}  // namespace tether::linalg
