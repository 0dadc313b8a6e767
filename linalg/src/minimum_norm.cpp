// Tether: minimum-norm solution of C dy = g in a diagonal metric.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tether/linalg/minimum_norm.hpp>

namespace tether::linalg {

namespace {

double dot(const double* a, const double* b, int n) {
  double sum = 0.0;
  for (int j = 0; j < n; ++j) sum += a[j] * b[j];
  return sum;
}

void add_multiple(double* a, double factor, const double* b, int n) {
  for (int j = 0; j < n; ++j) a[j] += factor * b[j];
}

// Two-norm; the plain sum of squares unless it leaves the range where it is exact enough.
double norm(const double* a, int n) {
  const double square = dot(a, a, n);
  if (square > 1e-280 && square < 1e280) return std::sqrt(square);
  double largest = 0.0;
  for (int j = 0; j < n; ++j) {
    if (!std::isfinite(a[j])) return std::numeric_limits<double>::quiet_NaN();
    largest = std::max(largest, std::abs(a[j]));
  }
  if (largest == 0.0) return 0.0;
  double sum = 0.0;
  for (int j = 0; j < n; ++j) sum += (a[j] / largest) * (a[j] / largest);
  return largest * std::sqrt(sum);
}

}  // namespace

void MinimumNorm::resize(int rows, int columns) {
  if (rows < 0 || columns < 0)
    throw std::invalid_argument("MinimumNorm::resize: rows = " + std::to_string(rows) +
                                ", columns = " + std::to_string(columns) + "; both must be >= 0");
  m_ = rows;
  n_ = columns;
  rank_ = 0;
  small_ = rows <= kSmallRows && columns <= kSmallColumns;
  const auto m = static_cast<std::size_t>(rows);
  const auto n = static_cast<std::size_t>(columns);
  pivot_.assign(m, 0);
  row_norm_.assign(m, 0.0);
  inconsistency_.assign(m, 0.0);
  metric_.assign(n, 0.0);
  if (!small_) {
    large_.resize(rows, columns);
    qr_ = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(columns, rows);
    work_.resize(std::max(rows, columns));
    rhs_.resize(std::max(rows, columns));
  }
}

double* MinimumNorm::row(int i) {
  return small_ ? a_.data() + static_cast<std::ptrdiff_t>(i) * n_ : large_.row(i).data();
}

// A = S C D in place. False if an entry is not finite.
bool MinimumNorm::scale_rows() {
  for (int i = 0; i < m_; ++i) {
    double* a = row(i);
    for (int j = 0; j < n_; ++j) a[j] *= metric_[static_cast<std::size_t>(j)];
    const double length = norm(a, n_);
    if (!std::isfinite(length)) return false;
    row_norm_[static_cast<std::size_t>(i)] = length;
    // A row below the normal range has no direction worth following.
    const double scale = length > std::numeric_limits<double>::min() ? 1.0 / length : 0.0;
    for (int j = 0; j < n_; ++j) a[j] *= scale;
  }
  return true;
}

bool MinimumNorm::factor(const double* D, double rank_tolerance) {
  std::copy(D, D + n_, metric_.begin());
  if (!scale_rows()) {
    rank_ = 0;
    return false;
  }
  if (small_) return factor_small(rank_tolerance);

  qr_.setThreshold(rank_tolerance);
  qr_.compute(large_.transpose());
  rank_ = qr_.maxPivot() > rank_tolerance ? static_cast<int>(qr_.rank()) : 0;
  for (int k = 0; k < m_; ++k)
    pivot_[static_cast<std::size_t>(k)] = static_cast<int>(qr_.colsPermutation().indices()[k]);
  return true;
}

bool MinimumNorm::factor_small(double rank_tolerance) {
  // rows[k] is the row of A in pivot position k: pointers move, data do not.
  double* rows[kSmallRows];
  double remaining[kSmallRows];  // squared length of what is left of each row, and at its last
  double reference[kSmallRows];  // recomputation
  for (int i = 0; i < m_; ++i) {
    pivot_[static_cast<std::size_t>(i)] = i;
    rows[i] = row(i);
    reference[i] = remaining[i] = row_norm_[static_cast<std::size_t>(i)] > 0.0 ? 1.0 : 0.0;
  }

  const int steps = std::min(m_, n_);
  rank_ = 0;
  for (int k = 0; k < steps; ++k) {
    int best = k;
    for (int i = k + 1; i < m_; ++i)
      if (remaining[i] > remaining[best]) best = i;
    if (best != k) {
      std::swap(rows[best], rows[k]);
      std::swap(remaining[best], remaining[k]);
      std::swap(reference[best], reference[k]);
      std::swap(pivot_[static_cast<std::size_t>(best)], pivot_[static_cast<std::size_t>(k)]);
    }

    double* v = rows[k] + k;
    const int length = n_ - k;
    const double size = std::sqrt(dot(v, v, length));
    if (!(size > rank_tolerance)) break;
    rank_ = k + 1;

    // Reflector I - tau v v^T with v[0] stored in place, R_kk apart (v is not normalised to 1).
    const double r = v[0] >= 0.0 ? -size : size;
    v[0] -= r;
    const double tau = -1.0 / (r * v[0]);
    diagonal_small_[static_cast<std::size_t>(k)] = r;
    tau_small_[static_cast<std::size_t>(k)] = tau;

    for (int i = k + 1; i < m_; ++i) {
      double* a = rows[i] + k;
      add_multiple(a, -tau * dot(v, a, length), v, length);
      remaining[i] -= a[0] * a[0];
      // Downdating loses digits when little is left: recompute (LAPACK working note 176).
      if (remaining[i] < 1e-6 * reference[i])
        reference[i] = remaining[i] = dot(a + 1, a + 1, length - 1);
    }
  }
  return true;
}

void MinimumNorm::solve(const double* g, double* dy) {
  if (small_) return solve_small(g, dy);

  const auto scaled = [&](int k) {
    const int i = pivot(k);
    const double length = row_norm_[static_cast<std::size_t>(i)];
    return length > std::numeric_limits<double>::min() ? g[i] / length : g[i];
  };
  const auto& R = qr_.matrixQR();
  for (int k = 0; k < rank_; ++k) rhs_[k] = scaled(k);
  R.topLeftCorner(rank_, rank_)
      .triangularView<Eigen::Upper>()
      .transpose()
      .solveInPlace(rhs_.head(rank_));
  for (int k = rank_; k < m_; ++k)
    inconsistency_[static_cast<std::size_t>(k)] =
        std::abs(scaled(k) - R.col(k).head(rank_).dot(rhs_.head(rank_)));

  Eigen::Map<Eigen::VectorXd> du(dy, n_);
  du.setZero();
  du.head(rank_) = rhs_.head(rank_);
  for (int k = rank_ - 1; k >= 0; --k)
    du.tail(n_ - k).applyHouseholderOnTheLeft(R.col(k).tail(n_ - k - 1), qr_.hCoeffs()[k],
                                              work_.data());
  for (int j = 0; j < n_; ++j) dy[j] *= metric_[static_cast<std::size_t>(j)];
}

void MinimumNorm::solve_small(const double* g, double* dy) {
  double z[kSmallRows];
  for (int k = 0; k < m_; ++k) {
    const int i = pivot_[static_cast<std::size_t>(k)];
    const double* a = row(i);
    const double length = row_norm_[static_cast<std::size_t>(i)];
    const double c = length > std::numeric_limits<double>::min() ? g[i] / length : g[i];
    const double left = c - dot(a, z, std::min(k, rank_));
    if (k < rank_)
      z[k] = left / diagonal_small_[static_cast<std::size_t>(k)];
    else
      inconsistency_[static_cast<std::size_t>(k)] = std::abs(left);
  }

  for (int k = 0; k < rank_; ++k) dy[k] = z[k];
  for (int j = rank_; j < n_; ++j) dy[j] = 0.0;
  for (int k = rank_ - 1; k >= 0; --k) {
    const double* v = row(pivot_[static_cast<std::size_t>(k)]) + k;
    const int length = n_ - k;
    add_multiple(dy + k, -tau_small_[static_cast<std::size_t>(k)] * dot(v, dy + k, length), v,
                 length);
  }
  for (int j = 0; j < n_; ++j) dy[j] *= metric_[static_cast<std::size_t>(j)];
}

std::vector<double> MinimumNorm::dependence(int k) const {
  // Row k of A, reduced to its first r entries by the reflectors, is R12; solve R11 x = R12.
  const int r = rank_;
  Eigen::VectorXd x(r);
  Eigen::MatrixXd R11 = Eigen::MatrixXd::Zero(r, r);
  if (small_) {
    const auto entry = [&](int column, int element) {
      return a_[static_cast<std::size_t>(pivot(column) * n_ + element)];
    };
    for (int i = 0; i < r; ++i) {
      x[i] = entry(k, i);
      R11(i, i) = diagonal_small_[static_cast<std::size_t>(i)];
      for (int j = i + 1; j < r; ++j) R11(i, j) = entry(j, i);
    }
  } else {
    x = qr_.matrixQR().col(k).head(r);
    R11 = qr_.matrixQR().topLeftCorner(r, r).triangularView<Eigen::Upper>();
  }
  R11.triangularView<Eigen::Upper>().solveInPlace(x);
  return {x.data(), x.data() + r};
}

double MinimumNorm::condition() const {
  if (rank_ == 0) return std::numeric_limits<double>::infinity();
  double smallest = std::numeric_limits<double>::infinity(), largest = 0.0;
  for (int k = 0; k < rank_; ++k) {
    const double r = std::abs(small_ ? diagonal_small_[static_cast<std::size_t>(k)]
                                     : qr_.matrixQR()(k, k));
    smallest = std::min(smallest, r);
    largest = std::max(largest, r);
  }
  return largest / smallest;
}

}  // namespace tether::linalg
