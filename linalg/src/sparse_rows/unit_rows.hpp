// Tether: the rows of C D at unit length, many of them sparse and a few full.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bordered_gram.hpp"

namespace tether::linalg {

inline double dot(const double* a, const double* b, std::size_t n) {
  double sum = 0.0;
  for (std::size_t j = 0; j < n; ++j) sum += a[j] * b[j];
  return sum;
}

// Scales a to unit length and returns its former length; 0 if it vanishes, NaN if it is not
// finite. Squares that would overflow or vanish are avoided by a first scaling.
inline double normalise(double* a, std::size_t n) {
  double sum = dot(a, a, n), first = 1.0;
  if (!(sum > 1e-200 && sum < 1e200)) {
    double largest = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      if (!std::isfinite(a[j])) return std::numeric_limits<double>::quiet_NaN();
      largest = std::max(largest, std::abs(a[j]));
    }
    if (largest <= std::numeric_limits<double>::min()) {
      std::fill(a, a + n, 0.0);
      return 0.0;
    }
    for (std::size_t j = 0; j < n; ++j) a[j] /= largest;
    first = largest;
    sum = dot(a, a, n);
  }
  const double norm = std::sqrt(sum), inverse = 1.0 / norm;
  for (std::size_t j = 0; j < n; ++j) a[j] *= inverse;
  return norm * first;
}

/// A = S C D, S = diag(1 / |row_i(C D)|), the sparse rows first; rows that vanish are zero.
class UnitRows {
 public:
  /// Takes the sparse rows in compressed form. Throws std::invalid_argument for an invalid pattern.
  void resize(int columns, std::vector<int> starts, std::vector<int> column_of, int full_rows) {
    const auto bad = [](const std::string& text) {
      throw std::invalid_argument("SparseMinimumNorm: " + text);
    };
    if (columns < 0 || full_rows < 0) bad("columns and full rows must be >= 0");
    if (starts.empty() || starts.front() != 0 ||
        starts.back() != static_cast<int>(column_of.size()) ||
        !std::is_sorted(starts.begin(), starts.end()))
      bad("starts must rise from 0 to the number of entries, one more than there are sparse rows");
    for (std::size_t i = 0; i + 1 < starts.size(); ++i)
      for (int e = starts[i]; e < starts[i + 1]; ++e) {
        const int j = column_of[static_cast<std::size_t>(e)];
        if (j < 0 || j >= columns ||
            (e > starts[i] && j <= column_of[static_cast<std::size_t>(e) - 1]))
          bad("columns of row " + std::to_string(i) + " must ascend within 0 .. " +
              std::to_string(columns - 1));
      }
    n_ = columns;
    sparse_ = static_cast<int>(starts.size()) - 1;
    full_ = full_rows;
    starts_ = std::move(starts);
    column_ = std::move(column_of);
    list_columns();
    const auto m = static_cast<std::size_t>(rows());
    A_.assign(column_.size(), 0.0);
    metric_.assign(width(), 0.0);
    full_rows_.assign(static_cast<std::size_t>(full_) * width(), 0.0);
    norm_.assign(m, 0.0);
    inverse_norm_.assign(m, 0.0);
  }
  /// Prepares the factors for the pattern.
  void analyse(BorderedGram& gram) const { gram.analyse(n_, starts_, column_, full_); }

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
  bool scale() { return scale_sparse() && scale_full(); }
  /// Factors A A^T + eps I and returns the number of dependent rows.
  int factor(BorderedGram& gram, double eps, double thin) {
    for (int f = 0; f < full_; ++f) {
      const double* a = full_row(f);
      for (int i = 0; i < sparse_; ++i) gram.coupling(f)[i] = row_dot(i, a);
      for (int e = 0; e <= f; ++e) gram.product(f, e) = dot(a, full_row(e), width());
    }
    return gram.factor(A_.data(), norm_.data(), eps, thin);
  }
  /// |row_i(C D)| and its inverse, both 0 for a row that vanishes.
  double norm(std::size_t i) const { return norm_[i]; }
  double inverse_norm(std::size_t i) const { return inverse_norm_[i]; }

  /// Computes z = A u.
  void multiply(const double* u, double* z) const {
    const double* entry = A_.data();
    const int* column = column_.data();
    const int *begin = column, *starts = starts_.data();
    for (int i = 0; i < sparse_; ++i) {
      double sum = 0.0;
      for (const int* end = begin + starts[i + 1]; column != end; ++column, ++entry)
        sum += *entry * u[*column];
      z[i] = sum;
    }
    for (int i = sparse_; i < rows(); ++i) z[i] = row_dot(i, u);
  }
  /// Computes u = A^T z.
  void transposed(const double* z, double* u) const {
    const double* value = by_column_.value.data();
    const int* row = by_column_.row.data();
    const int *begin = row, *starts = by_column_.starts.data();
    for (int j = 0; j < n_; ++j) {
      double sum = 0.0;
      for (const int* end = begin + starts[j + 1]; row != end; ++row, ++value)
        sum += *value * z[*row];
      u[j] = sum;
    }
    const double* a = full_rows_.data();
    for (int f = 0; f < full_; ++f, a += n_) {
      const double share = z[sparse_ + f];
      for (int j = 0; j < n_; ++j) u[j] += share * a[j];
    }
  }
  /// Writes row i of A with all its entries.
  void spread(int i, std::vector<double>& row) const {
    row.assign(width(), 0.0);
    if (i >= sparse_) {
      const double* a = full_rows_.data() + static_cast<std::size_t>(i - sparse_) * width();
      row.assign(a, a + width());
      return;
    }
    for (int e = starts_[static_cast<std::size_t>(i)]; e < starts_[static_cast<std::size_t>(i) + 1];
         ++e)
      row[static_cast<std::size_t>(column_[static_cast<std::size_t>(e)])] =
          A_[static_cast<std::size_t>(e)];
  }

 private:
  /// The sparse rows' entries by columns: the row of each, its index in A_ and its value.
  struct Columns {
    std::vector<int> starts{0}, row, entry;
    std::vector<double> value;
  };
  void list_columns() {
    Columns& c = by_column_;
    c.starts.assign(width() + 1, 0);
    for (const int j : column_) ++c.starts[static_cast<std::size_t>(j) + 1];
    std::partial_sum(c.starts.begin(), c.starts.end(), c.starts.begin());
    c.row.resize(column_.size());
    c.entry.resize(column_.size());
    c.value.assign(column_.size(), 0.0);
    std::vector<int> next(c.starts.begin(), c.starts.end() - 1);
    for (int i = 0; i < sparse_; ++i)
      for (int e = starts_[static_cast<std::size_t>(i)];
           e < starts_[static_cast<std::size_t>(i) + 1]; ++e) {
        const auto place = static_cast<std::size_t>(
            next[static_cast<std::size_t>(column_[static_cast<std::size_t>(e)])]++);
        c.row[place] = i;
        c.entry[place] = e;
      }
  }
  bool scale_sparse() {
    double* A = A_.data();
    const int* column = column_.data();
    for (int i = 0; i < sparse_; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const int begin = starts_[k], end = starts_[k + 1];
      for (int e = begin; e < end; ++e) A[e] *= metric_[static_cast<std::size_t>(column[e])];
      norm_[k] = normalise(A + begin, static_cast<std::size_t>(end - begin));
      if (!std::isfinite(norm_[k])) return false;
      inverse_norm_[k] = norm_[k] > 0.0 ? 1.0 / norm_[k] : 0.0;
    }
    for (std::size_t e = 0; e < by_column_.value.size(); ++e)
      by_column_.value[e] = A[by_column_.entry[e]];
    return true;
  }
  bool scale_full() {
    for (int f = 0; f < full_; ++f) {
      const auto k = static_cast<std::size_t>(sparse_ + f);
      double* a = full_row(f);
      for (std::size_t j = 0; j < width(); ++j) a[j] *= metric_[j];
      norm_[k] = normalise(a, width());
      if (!std::isfinite(norm_[k])) return false;
      inverse_norm_[k] = norm_[k] > 0.0 ? 1.0 / norm_[k] : 0.0;
    }
    return true;
  }
  double row_dot(int i, const double* u) const {
    if (i >= sparse_)
      return dot(full_rows_.data() + static_cast<std::size_t>(i - sparse_) * width(), u, width());
    double sum = 0.0;
    for (int e = starts_[static_cast<std::size_t>(i)]; e < starts_[static_cast<std::size_t>(i) + 1];
         ++e)
      sum += A_[static_cast<std::size_t>(e)] * u[column_[static_cast<std::size_t>(e)]];
    return sum;
  }

  int n_ = 0, sparse_ = 0, full_ = 0;
  std::vector<int> starts_{0}, column_;
  std::vector<double> A_, full_rows_, metric_, norm_, inverse_norm_;
  Columns by_column_;
};

}  // namespace tether::linalg
