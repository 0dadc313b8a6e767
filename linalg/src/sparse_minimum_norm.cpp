// Tether: minimum-norm solution of C dy = g for many sparse rows and a few full ones.
// SPDX-License-Identifier: BSD-3-Clause
#include "tether/linalg/sparse_minimum_norm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "bordered_gram.hpp"

namespace tether::linalg {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kSmallestEps = 1e-13;  // A A^T of unit rows carries some 1e-15 of rounding
constexpr double kHalving = 0.5;        // a step that leaves more of the residual is the last one
constexpr int kProximalSteps = 8;
constexpr int kGradientSteps = 10;
constexpr int kFilters = 3;

double dot(const double* a, const double* b, std::size_t n) {
  double sum = 0.0;
  for (std::size_t j = 0; j < n; ++j) sum += a[j] * b[j];
  return sum;
}

// Scales a to unit length and returns its former length; 0 if it vanishes, NaN if it is not
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
  step_.assign(width(), 0.0);
  p_.assign(width(), 0.0);
  for (std::vector<double>* rows : {&b_, &left_, &z_, &Ap_, &MAp_}) rows->assign(m, 0.0);
  full_rows_.assign(f * width(), 0.0);
  norm_.assign(m, 0.0);
  inverse_norm_.assign(m, 0.0);
  order_.assign(m, 0);
  dropped_.clear();
  dropped_.reserve(m);
  inconsistency_.reserve(m);
  gram_ = std::make_unique<BorderedGram>();
  gram_->analyse(n_, starts_, column_, full_);
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

// z = A u
void SparseMinimumNorm::multiply(const double* u, double* z) const {
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

// u = A^T z; returns |u|.
double SparseMinimumNorm::transposed(const double* z, double* u) const {
  std::fill(u, u + n_, 0.0);
  const double* entry = A_.data();
  const int* column = column_.data();
  const int *begin = column, *starts = starts_.data();
  for (int i = 0; i < sparse_; ++i) {
    const double share = z[i];
    for (const int* end = begin + starts[i + 1]; column != end; ++column, ++entry)
      u[*column] += *entry * share;
  }
  const double* a = full_rows_.data();
  for (int f = 0; f < full_; ++f, a += n_) {
    const double share = z[sparse_ + f];
    for (int j = 0; j < n_; ++j) u[j] += share * a[j];
  }
  return std::sqrt(dot(u, u, width()));
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

void SparseMinimumNorm::couple_full() {
  for (int f = 0; f < full_; ++f) {
    const double* a = full_row(f);
    for (int i = 0; i < sparse_; ++i) gram_->coupling(f)[i] = row_dot(i, a);
    for (int e = 0; e <= f; ++e) gram_->product(f, e) = dot(a, full_row(e), width());
  }
}

bool SparseMinimumNorm::factor(double rank_tolerance) {
  if (!scale_sparse() || !scale_full()) return false;
  couple_full();
  eps_ = std::max(rank_tolerance * rank_tolerance, kSmallestEps);
  const int dependent = gram_->factor(A_.data(), norm_.data(), eps_);
  dropped_.clear();
  for (int i = 0; dependent > 0 && i < rows(); ++i)
    if (gram_->dependent(i)) dropped_.push_back(i);
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

// left_ = b - A du; returns its length.
double SparseMinimumNorm::find_left() {
  multiply(du_.data(), left_.data());
  for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = b_[i] - left_[i];
  return std::sqrt(dot(left_.data(), left_.data(), left_.size()));
}

// z_ = M^-1 left_, step_ = A^T z_; returns |step_|.
double SparseMinimumNorm::find_step() {
  z_ = left_;
  gram_->solve(z_.data());
  ++iterations_;
  return transposed(z_.data(), step_.data());
}

// Is the residual small enough, or does du no longer change?
bool SparseMinimumNorm::done(double step, double left) const {
  const double length = std::sqrt(dot(du_.data(), du_.data(), width()));
  return left <= tolerance_ * size_ + 2.0 * kEpsilon * length || step <= tolerance_ * length;
}

void SparseMinimumNorm::take_back(double share, const std::vector<double>& step, double* left) {
  for (std::size_t j = 0; j < width(); ++j) du_[j] -= share * step[j];
  *left = find_left();
}

// From du = 0. Returns false where more of them would reduce the residual too slowly.
bool SparseMinimumNorm::proximal_steps(double* left) {
  for (int k = 0; k < kProximalSteps; ++k) {
    const double step = find_step(), before = *left;
    for (std::size_t j = 0; j < width(); ++j) du_[j] += step_[j];
    *left = find_left();
    if (*left > before) {  // rounding rules: b has no part that the rows can give
      take_back(1.0, step_, left);
      return true;
    }
    if (done(step, *left)) return true;
    if (k > 0 && *left > kHalving * before) return false;
  }
  return false;
}

// Least squares by conjugate gradients (Golub and Van Loan, section 11.3.9) in the norm of M^-1:
// what proximal steps do, with the best multiple of each direction.
void SparseMinimumNorm::gradient_steps(double* left) {
  double square = std::pow(find_step(), 2);
  p_ = step_;
  for (int k = 0; k < kGradientSteps; ++k) {
    multiply(p_.data(), Ap_.data());
    MAp_ = Ap_;
    gram_->solve(MAp_.data());
    ++iterations_;
    const double curvature = dot(Ap_.data(), MAp_.data(), Ap_.size());
    if (!(curvature > 0.0)) return;
    const double share = square / curvature, before = *left;
    for (std::size_t j = 0; j < width(); ++j) du_[j] += share * p_[j];
    for (std::size_t i = 0; i < z_.size(); ++i) z_[i] -= share * MAp_[i];
    *left = find_left();
    if (*left > before) return take_back(share, p_, left);  // rounding rules
    const double step = transposed(z_.data(), step_.data()), next = step * step;
    if (done(step, *left)) return;
    for (std::size_t j = 0; j < width(); ++j) p_[j] = step_[j] + next / square * p_[j];
    square = next;
  }
}

void SparseMinimumNorm::solve(const double* g, double* dy, double tolerance) {
  for (std::size_t i = 0; i < b_.size(); ++i) left_[i] = b_[i] = g[i] * inverse_norm_[i];
  std::fill(du_.begin(), du_.end(), 0.0);
  iterations_ = 0;
  tolerance_ = tolerance;
  size_ = std::sqrt(dot(b_.data(), b_.data(), b_.size()));
  double left = size_;
  if (size_ > 0.0 && !proximal_steps(&left)) gradient_steps(&left);
  residual_ = size_ > 0.0 ? left / size_ : 0.0;
  find_inconsistencies(g);
  for (std::size_t j = 0; j < width(); ++j) dy[j] = du_[j] * metric_[j];
}

// L^-1 (b - A du): entry k is the difference of row k from the combination of rows before it.
void SparseMinimumNorm::find_inconsistencies(const double* g) {
  inconsistency_.clear();
  if (dropped_.empty()) return;
  z_ = left_;
  gram_->forward(z_.data());
  for (const int i : dropped_) {
    const auto k = static_cast<std::size_t>(i);
    inconsistency_.push_back(std::abs(norm_[k] > 0.0 ? z_[k] : g[i]));
  }
}

// Proximal steps on A A^T x = A u. Rounding of A (u - A^T x), over eps, stays in the null space of
// A^T; x <- x - eps M^-1 x takes most of that away, and eps / s^2 of the rest, which further steps
// bring back: they start from so small a residual that their own rounding counts for nothing.
void SparseMinimumNorm::multipliers(const double* dy, double* x) {
  const std::size_t m = Ap_.size();
  std::fill(x, x + m, 0.0);
  add_multipliers(dy, x);
  for (int k = 0; k < kFilters; ++k) {
    std::copy(x, x + m, MAp_.begin());
    gram_->solve(MAp_.data());
    for (std::size_t i = 0; i < m; ++i) x[i] -= eps_ * MAp_[i];
  }
  add_multipliers(dy, x);
  for (std::size_t i = 0; i < m; ++i) x[i] *= inverse_norm_[i];
}

// x <- x + M^-1 A (u - A^T x), D u = dy, as long as the steps halve.
void SparseMinimumNorm::add_multipliers(const double* dy, double* x) {
  const std::size_t m = Ap_.size();
  double before = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kProximalSteps; ++k) {
    transposed(x, step_.data());
    for (std::size_t j = 0; j < width(); ++j)
      p_[j] = (metric_[j] > 0.0 ? dy[j] / metric_[j] : 0.0) - step_[j];
    multiply(p_.data(), MAp_.data());
    gram_->solve(MAp_.data());
    const double step = std::sqrt(dot(MAp_.data(), MAp_.data(), m));
    if (!(step < kHalving * before)) return;
    before = step;
    for (std::size_t i = 0; i < m; ++i) x[i] += MAp_[i];
    if (step <= kTolerance * std::sqrt(dot(x, x, m))) return;
  }
}

// Two rounds; the second one removes the error due to eps.
std::vector<double> SparseMinimumNorm::dependence(int k) const {
  const int row = pivot(k);
  std::vector<double> rest(width(), 0.0), share(norm_.size(), 0.0), z(norm_.size()), part(width());
  if (row >= sparse_) {
    const double* a = full_rows_.data() + static_cast<std::size_t>(row - sparse_) * width();
    rest.assign(a, a + width());
  } else {
    for (int e = starts_[static_cast<std::size_t>(row)];
         e < starts_[static_cast<std::size_t>(row) + 1]; ++e)
      rest[static_cast<std::size_t>(column_[static_cast<std::size_t>(e)])] =
          A_[static_cast<std::size_t>(e)];
  }
  for (int round = 0; round < 2; ++round) {
    multiply(rest.data(), z.data());
    gram_->depend(z.data(), row);
    transposed(z.data(), part.data());
    for (std::size_t j = 0; j < width(); ++j) rest[j] -= part[j];
    for (std::size_t i = 0; i < z.size(); ++i) share[i] += z[i];
  }
  std::vector<double> kept;
  for (int i = 0; i < rank(); ++i) kept.push_back(share[static_cast<std::size_t>(pivot(i))]);
  return kept;
}

}  // namespace tether::linalg
