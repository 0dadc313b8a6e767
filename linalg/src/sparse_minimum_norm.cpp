// Tether: minimum-norm solution of C dy = g for many sparse rows and a few full ones.
// SPDX-License-Identifier: BSD-3-Clause
#include "tether/linalg/sparse_minimum_norm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "gram_factor.hpp"

namespace tether::linalg {

namespace {

constexpr double kAnew = 0.1;  // q shorter than this part of a is orthogonalised twice

double dot(const double* a, const double* b, std::size_t n) {
  double sum = 0.0;
  for (std::size_t j = 0; j < n; ++j) sum += a[j] * b[j];
  return sum;
}

// Scales a to unit length and returns what that was; 0 where it vanishes, NaN where it is not
// finite. Squares that would overflow or vanish are avoided by a first scaling.
double normalise(double* a, std::size_t n) {
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

}  // namespace

SparseMinimumNorm::SparseMinimumNorm() = default;
SparseMinimumNorm::~SparseMinimumNorm() = default;
SparseMinimumNorm::SparseMinimumNorm(SparseMinimumNorm&&) noexcept = default;
SparseMinimumNorm& SparseMinimumNorm::operator=(SparseMinimumNorm&&) noexcept = default;

void SparseMinimumNorm::resize(int columns, std::vector<int> starts, std::vector<int> column_of,
                               int full_rows) {
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
  const auto m = static_cast<std::size_t>(rows());
  const auto f = static_cast<std::size_t>(full_);
  A_.assign(column_.size(), 0.0);
  metric_.assign(width(), 0.0);
  du_.assign(width(), 0.0);
  z_.assign(static_cast<std::size_t>(sparse_), 0.0);
  full_rows_.assign(f * width(), 0.0);
  apart_.assign(f * width(), 0.0);
  along_.assign(f, 0.0);
  norm_.assign(m, 0.0);
  inverse_norm_.assign(m, 0.0);
  order_.assign(m, 0);
  dropped_.clear();
  dropped_.reserve(m);
  inconsistency_.reserve(m);
  gram_ = std::make_unique<GramFactor>();
  gram_->analyse(n_, starts_, column_);
}

double SparseMinimumNorm::row_dot(int i, const double* u) const {
  if (i >= sparse_)
    return dot(full_rows_.data() + static_cast<std::size_t>(i - sparse_) * width(), u, width());
  double sum = 0.0;
  for (int e = starts_[static_cast<std::size_t>(i)]; e < starts_[static_cast<std::size_t>(i) + 1];
       ++e)
    sum += A_[static_cast<std::size_t>(e)] * u[column_[static_cast<std::size_t>(e)]];
  return sum;
}

// u <- u + sign A^T z over the sparse rows.
void SparseMinimumNorm::add_rows(const double* z, double sign, double* u) const {
  const double* entry = A_.data();
  const int* column = column_.data();
  const int *begin = column, *starts = starts_.data();
  for (int i = 0; i < sparse_; ++i) {
    const double share = sign * z[i];
    for (const int* end = begin + starts[i + 1]; column != end; ++column, ++entry)
      u[*column] += *entry * share;
  }
}

bool SparseMinimumNorm::scale_sparse() {
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
  return true;
}

bool SparseMinimumNorm::scale_full() {
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

// row <- row - A^T (A A^T)^-1 A row
void SparseMinimumNorm::take_out_sparse(double* row) {
  for (int i = 0; i < sparse_; ++i) z_[static_cast<std::size_t>(i)] = row_dot(i, row);
  gram_->solve(z_.data());
  add_rows(z_.data(), -1.0, row);
}

// q_f of each full row: orthogonal to the sparse rows and to the q before it.
void SparseMinimumNorm::orthogonalise() {
  for (int f = 0; f < full_; ++f) {
    const double* a = full_row(f);
    double* q = apart_.data() + static_cast<std::size_t>(f) * width();
    std::copy(a, a + width(), q);
    double length = 1.0;
    for (int pass = 0; pass < 2; ++pass) {
      take_out_sparse(q);
      for (int e = 0; e < f; ++e) {
        if (along_[static_cast<std::size_t>(e)] == 0.0) continue;
        const double* other = apart_.data() + static_cast<std::size_t>(e) * width();
        const double share = dot(other, q, width());
        for (std::size_t j = 0; j < width(); ++j) q[j] -= share * other[j];
      }
      length = std::sqrt(dot(q, q, width()));
      if (length > kAnew) break;
    }
    along_[static_cast<std::size_t>(f)] = length;
    if (length > 0.0)
      for (std::size_t j = 0; j < width(); ++j) q[j] /= length;
  }
}

bool SparseMinimumNorm::factor(double rank_tolerance) {
  if (!scale_sparse() || !scale_full()) return false;
  const int left_out = gram_->factor(A_.data(), norm_.data(), rank_tolerance * rank_tolerance);
  orthogonalise();
  dropped_.clear();
  if (left_out > 0)
    for (int i = 0; i < sparse_; ++i)
      if (!gram_->kept(i)) dropped_.push_back(i);
  for (int f = 0; f < full_; ++f) {
    double& along = along_[static_cast<std::size_t>(f)];
    if (along > rank_tolerance) continue;
    along = 0.0;
    dropped_.push_back(sparse_ + f);
  }
  std::size_t kept = 0, next = 0;
  for (int i = 0; i < rows(); ++i) {
    if (next < dropped_.size() && dropped_[next] == i)
      ++next;
    else
      order_[kept++] = i;
  }
  std::copy(dropped_.begin(), dropped_.end(), order_.begin() + static_cast<std::ptrdiff_t>(kept));
  return true;
}

void SparseMinimumNorm::solve(const double* g, double* dy) {
  for (int i = 0; i < sparse_; ++i)
    z_[static_cast<std::size_t>(i)] = g[i] * inverse_norm_[static_cast<std::size_t>(i)];
  gram_->solve(z_.data());
  std::fill(du_.begin(), du_.end(), 0.0);
  add_rows(z_.data(), 1.0, du_.data());
  for (int f = 0; f < full_; ++f) {
    const auto k = static_cast<std::size_t>(f), i = k + static_cast<std::size_t>(sparse_);
    if (along_[k] == 0.0) continue;
    const double* q = apart_.data() + k * width();
    const double left = g[i] * inverse_norm_[i] - row_dot(static_cast<int>(i), du_.data());
    const double share = left / along_[k];
    for (std::size_t j = 0; j < width(); ++j) du_[j] += share * q[j];
  }
  inconsistency_.clear();
  for (const int i : dropped_) {
    const double scale = inverse_norm_[static_cast<std::size_t>(i)];
    inconsistency_.push_back(std::abs(scale > 0.0 ? row_dot(i, du_.data()) - scale * g[i] : g[i]));
  }
  for (std::size_t j = 0; j < width(); ++j) dy[j] = du_[j] * metric_[j];
}

// a_k = sum of shares of the kept rows: those of the full rows from the last to the first, then the
// sparse ones by (A A^T)^-1 A of the rest.
std::vector<double> SparseMinimumNorm::dependence(int k) const {
  const int row = pivot(k);
  std::vector<double> rest(width(), 0.0), share(static_cast<std::size_t>(rows()), 0.0);
  if (row >= sparse_) {
    const double* a = full_rows_.data() + static_cast<std::size_t>(row - sparse_) * width();
    rest.assign(a, a + width());
  } else {
    for (int e = starts_[static_cast<std::size_t>(row)];
         e < starts_[static_cast<std::size_t>(row) + 1]; ++e)
      rest[static_cast<std::size_t>(column_[static_cast<std::size_t>(e)])] =
          A_[static_cast<std::size_t>(e)];
  }
  for (int f = std::min(row - sparse_, full_) - 1; f >= 0; --f) {
    const auto e = static_cast<std::size_t>(f);
    if (along_[e] == 0.0) continue;
    const double* a = full_rows_.data() + e * width();
    const double part = dot(apart_.data() + e * width(), rest.data(), width()) / along_[e];
    for (std::size_t j = 0; j < width(); ++j) rest[j] -= part * a[j];
    share[static_cast<std::size_t>(sparse_) + e] = part;
  }
  std::vector<double> z(static_cast<std::size_t>(sparse_));
  for (int i = 0; i < sparse_; ++i) z[static_cast<std::size_t>(i)] = row_dot(i, rest.data());
  gram_->solve(z.data());
  std::copy(z.begin(), z.end(), share.begin());
  std::vector<double> kept;
  for (int i = 0; i < rank(); ++i) kept.push_back(share[static_cast<std::size_t>(pivot(i))]);
  return kept;
}

}  // namespace tether::linalg
