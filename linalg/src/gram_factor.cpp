// Tether: L diag(d) L^T of A A^T for sparse A. SPDX-License-Identifier: BSD-3-Clause
//
// Row by row ("up-looking"; T. A. Davis, Direct Methods for Sparse Linear Systems, section 4.8):
// row k of L solves a triangular system with the rows above it. A dependent row is left out by
// 1/d_k = 0, which makes its column of L zero.
#include "gram_factor.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <numeric>

namespace tether::linalg {

namespace {

using Lists = std::vector<std::vector<int>>;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// place[i] of row i in the order of elimination.
std::vector<int> minimum_degree(int m, const Lists& in_column, const std::vector<int>& row) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < m; ++i) entries.emplace_back(i, i, 1.0);  // without a diagonal it gives up
  for (const auto& column : in_column)
    for (const int a : column)
      for (const int b : column)
        if (row[at(a)] > row[at(b)]) entries.emplace_back(row[at(a)], row[at(b)], 1.0);
  Eigen::SparseMatrix<double> gram(m, m);
  gram.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> inverse;
  Eigen::AMDOrdering<int>()(gram.selfadjointView<Eigen::Lower>(), inverse);
  std::vector<int> place(at(m));
  for (int k = 0; k < m; ++k) place[at(inverse.indices()[k])] = k;
  return place;
}

}  // namespace

void GramFactor::analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns) {
  m_ = static_cast<int>(starts.size()) - 1;
  std::vector<int> row(columns.size());
  Lists in_column(at(n));
  for (int i = 0; i < m_; ++i)
    for (int e = starts[at(i)]; e < starts[at(i) + 1]; ++e) {
      row[at(e)] = i;
      in_column[at(columns[at(e)])].push_back(e);
    }
  place_ = minimum_degree(m_, in_column, row);
  row_at_.resize(at(m_));
  for (int i = 0; i < m_; ++i) row_at_[at(place_[at(i)])] = i;
  find_products(in_column, row);
  find_factor_pattern();
  work_.assign(at(m_), 0.0);  // zero between calls of factor()
  solution_.assign(at(m_), 0.0);
  inverse_d_.assign(at(m_), 0.0);
}

void GramFactor::find_products(const Lists& in_column, const std::vector<int>& row) {
  std::vector<std::array<int, 4>> all;  // row and column of the product, entries
  for (const auto& column : in_column)
    for (const int a : column)
      for (const int b : column) {
        const int i = place_[at(row[at(a)])], j = place_[at(row[at(b)])];
        if (i > j) all.push_back({i, j, a, b});
      }
  std::sort(all.begin(), all.end());
  gram_starts_.assign(at(m_) + 1, 0);
  gram_columns_.clear();
  product_starts_.clear();
  products_.clear();
  for (std::size_t p = 0; p < all.size(); ++p) {
    if (p == 0 || all[p][0] != all[p - 1][0] || all[p][1] != all[p - 1][1]) {
      ++gram_starts_[at(all[p][0]) + 1];
      gram_columns_.push_back(all[p][1]);
      product_starts_.push_back(static_cast<int>(products_.size()));
    }
    products_.push_back({all[p][2], all[p][3]});
  }
  product_starts_.push_back(static_cast<int>(products_.size()));
  std::partial_sum(gram_starts_.begin(), gram_starts_.end(), gram_starts_.begin());
}

// Row k of L has the columns on the elimination tree's paths from the entries of row k of A A^T.
void GramFactor::find_factor_pattern() {
  std::vector<int> parent(at(m_), -1), seen(at(m_), -1);
  row_starts_.assign(1, 0);
  row_columns_.clear();
  column_starts_.assign(at(m_) + 1, 0);
  for (int k = 0; k < m_; ++k) {
    seen[at(k)] = k;
    for (int p = gram_starts_[at(k)]; p < gram_starts_[at(k) + 1]; ++p)
      for (int j = gram_columns_[at(p)]; seen[at(j)] != k; j = parent[at(j)]) {
        if (parent[at(j)] == -1) parent[at(j)] = k;
        seen[at(j)] = k;
        row_columns_.push_back(j);
        ++column_starts_[at(j) + 1];
      }
    std::sort(row_columns_.begin() + row_starts_.back(), row_columns_.end());
    row_starts_.push_back(static_cast<int>(row_columns_.size()));
  }
  std::partial_sum(column_starts_.begin(), column_starts_.end(), column_starts_.begin());
  filled_.assign(column_starts_.begin(), column_starts_.end() - 1);
  column_rows_.assign(row_columns_.size(), 0);
  L_.assign(row_columns_.size(), 0.0);
  for (int k = 0; k < m_; ++k)
    for (int p = row_starts_[at(k)]; p < row_starts_[at(k) + 1]; ++p)
      column_rows_[at(filled_[at(row_columns_[at(p)])]++)] = k;
}

int GramFactor::factor(const double* A, const double* norm, double smallest) {
  int left_out = 0;
  double* __restrict y = work_.data();
  double* __restrict L = L_.data();
  double* __restrict inverse_d = inverse_d_.data();
  int* __restrict filled = filled_.data();
  const int *rows = column_rows_.data(), *column_starts = column_starts_.data();
  const int *gram_column = gram_columns_.data(), *row_column = row_columns_.data();
  const int* last = product_starts_.data() + 1;
  const Product* product = products_.data();
  std::copy(column_starts_.begin(), column_starts_.end() - 1, filled_.begin());
  for (int k = 0; k < m_; ++k) {
    for (const int* end = gram_columns_.data() + gram_starts_[at(k) + 1]; gram_column < end;
         ++gram_column, ++last) {
      double sum = 0.0;
      for (const Product* stop = products_.data() + *last; product < stop; ++product)
        sum += A[product->a] * A[product->b];
      y[*gram_column] = sum;
    }
    double d = norm[row_at_[at(k)]] > 0.0 ? 1.0 : 0.0;
    for (const int* end = row_columns_.data() + row_starts_[at(k) + 1]; row_column < end;
         ++row_column) {
      const int j = *row_column;
      const double yj = y[j];
      y[j] = 0.0;
      const int stop = filled[j]++;
      for (int q = column_starts[j]; q < stop; ++q) y[rows[q]] -= L[q] * yj;
      const double entry = yj * inverse_d[j];
      d -= entry * yj;
      L[stop] = entry;
    }
    const bool dependent = !(d > smallest);
    left_out += dependent;
    inverse_d[k] = dependent ? 0.0 : 1.0 / d;
  }
  return left_out;
}

void GramFactor::solve(double* z) {
  double* __restrict x = solution_.data();
  const double* __restrict L = L_.data();
  const double* __restrict inverse_d = inverse_d_.data();
  const int *rows = column_rows_.data(), *starts = column_starts_.data(), *place = place_.data();
  for (int i = 0; i < m_; ++i) x[place[i]] = z[i];
  for (int j = 0; j < m_; ++j) {
    const double xj = x[j];
    for (int q = starts[j]; q < starts[j + 1]; ++q) x[rows[q]] -= L[q] * xj;
  }
  for (int j = m_ - 1; j >= 0; --j) {
    double xj = x[j] * inverse_d[j];
    for (int q = starts[j]; q < starts[j + 1]; ++q) xj -= L[q] * x[rows[q]];
    x[j] = xj;
  }
  for (int i = 0; i < m_; ++i) z[i] = x[place[i]];
}

}  // namespace tether::linalg
