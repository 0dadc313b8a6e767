// Tether: minimum-norm solution of C dy = g in a diagonal metric.
// SPDX-License-Identifier: BSD-3-Clause
#include <numeric>
#include <stdexcept>
#include <string>
#include <tether/linalg/minimum_norm.hpp>

#include "large_rows.hpp"
#include "small_kept_rows.hpp"
#include "small_orthogonal.hpp"

namespace tether::linalg {

namespace {

constexpr double kLeastShare = 1.0 / 3.0;  // of factor_kept()
// Entries of C above which A A^T is tried first: the orthogonal factorisation goes through a matrix
// that no longer fits into fast memory once for each row.
constexpr double kMany = 262144.0;

}  // namespace

MinimumNorm::MinimumNorm() = default;
MinimumNorm::MinimumNorm(int rows, int columns) { resize(rows, columns); }
MinimumNorm::~MinimumNorm() = default;
MinimumNorm::MinimumNorm(MinimumNorm&&) noexcept = default;
MinimumNorm& MinimumNorm::operator=(MinimumNorm&&) noexcept = default;

void MinimumNorm::resize(int rows, int columns) {
  if (rows < 0 || columns < 0)
    throw std::invalid_argument("MinimumNorm::resize: rows = " + std::to_string(rows) +
                                ", columns = " + std::to_string(columns) + "; both must be >= 0");
  m_ = rows;
  n_ = columns;
  kept_ = false;
  set_rank(0);
  const auto m = static_cast<std::size_t>(rows);
  inconsistency_.assign(m, 0.0);
  if (rows <= kSmallRows && columns <= kSmallColumns) {
    kernel_ = &small::kernel_for(columns);
    if (!small_) small_ = std::make_unique<small::Storage>();
    if (!small_kept_) small_kept_ = std::make_unique<small::KeptRows>();
    small_->clear();
    small_kept_->resize(rows);
    metric_.assign(static_cast<std::size_t>(kernel_->stride), 0.0);
  } else {
    kernel_ = nullptr;
    metric_.assign(static_cast<std::size_t>(columns), 0.0);
    row_norm_.assign(m, 0.0);
    if (!large_) large_ = std::make_unique<Large>();
    large_->A.resize(rows, columns);
    large_->qr = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(columns, rows);
    large_->work.resize(std::max(rows, columns));
    large_->rhs.resize(std::max(rows, columns));
    large_->kept.resize(rows, columns);
    large_->order.assign(m, 0);
    large_->to_unit.assign(m, 1.0);
    large_->split = false;
    if (splits()) {
      large_->natural.resize(m);
      std::iota(large_->natural.begin(), large_->natural.end(), 0);
      large_->rest.resize(rows, columns);
      large_->left.resize(rows);
    }
  }
}

bool MinimumNorm::splits() const { return static_cast<double>(m_) * n_ > kMany; }

void MinimumNorm::set_rank(int rank) {
  rank_ = factored_rank_ = rank;
  least_square_ = 1.0;
  if (rank > 0)
    least_square_ = kernel_ != nullptr ? small_->ratio[rank - 1]
                                       : std::pow(large_->qr.matrixQR()(rank - 1, rank - 1), 2);
}

double* MinimumNorm::row(int i) {
  return kernel_ != nullptr ? small_->u + static_cast<std::ptrdiff_t>(i) * kernel_->stride
                            : large_->A.row(i).data();
}

bool MinimumNorm::factor(const double* D, double rank_tolerance) {
  for (int j = 0; j < n_; ++j) metric_[static_cast<std::size_t>(j)] = D[j];
  set_rank(0);
  kept_ = false;
  if (kernel_ == nullptr) {
    large_->split = false;
    if (!scale_large()) return false;
    if (splits()) {
      large_->kept.load(large_->A.data());
      if (factor_split(rank_tolerance)) return true;
    }
    return factor_orthogonal(rank_tolerance);
  }
  if (!kernel_->form_rows(*small_, m_, metric_.data())) return false;
  set_rank(kernel_->factor(*small_, m_, n_, rank_tolerance));
  return true;
}

bool MinimumNorm::factor(const double* wide, int width, const int* rows, const int* columns,
                         double rank_tolerance, const FilledPlaces* places) {
  set_rank(0);
  kept_ = false;
  if (kernel_ != nullptr) {
    if (!kernel_->gather_rows(*small_, m_, n_, wide, width, rows, columns, metric_.data()))
      return false;
    set_rank(kernel_->factor(*small_, m_, n_, rank_tolerance));
    return true;
  }
  large_->split = false;
  if (splits()) {
    if (!large_->kept.load(wide, width, rows, columns, metric_.data(), row_norm_.data(), places))
      return false;
    if (factor_split(rank_tolerance)) return true;
  }
  gather_large(wide, width, rows, columns);
  return scale_large() && factor_orthogonal(rank_tolerance);
}

void MinimumNorm::gather_large(const double* wide, int width, const int* rows, const int* columns) {
  for (int i = 0; i < m_; ++i) {
    const double* c = wide + static_cast<std::ptrdiff_t>(rows[i]) * width;
    double* a = large_->A.row(i).data();
    for (int j = 0; j < n_; ++j) a[j] = c[columns[j]];
  }
}

// Turns the rows of C into unit rows of C D. Returns false if an entry is not finite.
bool MinimumNorm::scale_large() {
  auto& A = large_->A;
  const Eigen::Map<const Eigen::VectorXd> D(metric_.data(), n_);
  for (int i = 0; i < m_; ++i) {
    A.row(i) = A.row(i).cwiseProduct(D.transpose());
    const double square = A.row(i).squaredNorm();
    const double length = square > 1e-280 && square < 1e280
                              ? std::sqrt(square)
                              : small::careful_norm(A.row(i).data(), n_);
    if (!std::isfinite(length)) return false;
    row_norm_[static_cast<std::size_t>(i)] = length;
    A.row(i) *= length > std::numeric_limits<double>::min() ? 1.0 / length : 0.0;
  }
  return true;
}

// Returns the least independent part in the order that factor_kept() uses, or 0 if the rows are not
// independent.
double MinimumNorm::least_of_decided() {
  const double least = independent_part(rank_ - 1);
  if (kernel_ != nullptr || least < kLeastSine) return least;
  KeptRows& kept = large_->kept;
  if (!large_->split) kept.load(large_->A.data());
  return kept.factor(large_->order.data(), rank_) ? kept.least_part(rank_) : 0.0;
}

bool MinimumNorm::factor_kept(const double* wide, int width, const int* rows, const int* columns,
                              const FilledPlaces* places) {
  if (kernel_ != nullptr) return factor_kept_small({wide, width, rows, columns, metric_.data()});
  const int r = rank_;
  if (r == 0) return false;
  const bool split = large_->split;
  if (!kept_ || split) decided_least_ = least_of_decided();
  if (decided_least_ < kLeastSine) return false;
  kept_ = false;
  if (split) large_->split = false;
  KeptRows& kept = large_->kept;
  if (!kept.load(wide, width, rows, columns, metric_.data(), row_norm_.data(), places))
    return false;
  if (!kept.factor(large_->order.data(), r)) return false;
  const double least = kept.least_part(r);
  if (!(least >= std::max(kLeastSine, kLeastShare * decided_least_))) return false;
  kept_ = true;
  large_->learn_units(row_norm_);
  rank_ = factored_rank_ = r;
  least_square_ = least * least;
  return true;
}

void MinimumNorm::Large::learn_units(const std::vector<double>& row_norm) {
  for (std::size_t i = 0; i < row_norm.size(); ++i)
    to_unit[i] = row_norm[i] > std::numeric_limits<double>::min() ? 1.0 / row_norm[i] : 1.0;
}

bool MinimumNorm::factor_kept_small(const small::Gathered& from) {
  if (rank_ == 0 || rank_ < m_) return false;
  small::Storage& s = *small_;
  if (!kept_) {
    decided_least_ = least_of_decided();
    if (decided_least_ < kLeastSine) return false;
    for (int k = 0; k < m_; ++k) s.scale[k] = 1.0;
  }
  const double sine = std::max(kLeastSine, kLeastShare * decided_least_);
  kept_ = small_kept_->factor(*small_kept_, from, s.pivot, m_, n_, sine * sine, s.square, s.ratio);
  if (!kept_) {
    set_rank(0);  // what was known of the rows is overwritten
    return false;
  }
  double least = 1.0;
  for (int k = 0; k < m_; ++k) least = s.ratio[k] < least ? s.ratio[k] : least;
  least_square_ = least;
  return true;
}

bool MinimumNorm::factor_orthogonal(double rank_tolerance) {
  auto& qr = large_->qr;
  qr.setThreshold(rank_tolerance);
  qr.compute(large_->A.transpose());
  const int* const pivots = qr.colsPermutation().indices().data();
  large_->order.assign(pivots, pivots + m_);
  set_rank(qr.maxPivot() > rank_tolerance ? static_cast<int>(qr.rank()) : 0);
  return true;
}

double MinimumNorm::scaled(const double* g, int i) const {
  const double length = row_norm_[static_cast<std::size_t>(i)];
  return length > std::numeric_limits<double>::min() ? g[i] / length : g[i];
}

void MinimumNorm::solve(const double* g, double* dy) {
  if (kernel_ != nullptr && kept_)
    small_kept_->solve(*small_kept_, small_->pivot, n_, g, metric_.data(), dy);
  else
    kernel_ != nullptr ? solve_small(g, dy)
    : kept_            ? solve_kept(g, dy)
    : large_->split    ? solve_split(g, dy)
                       : solve_orthogonal(g, dy);
}

void MinimumNorm::solve_small(const double* g, double* dy) {
  const small::Storage& s = *small_;
  double z[kSmallRows];
  for (int k = 0; k < m_; ++k) {
    const int i = s.pivot[k];
    const double* L = s.L + i * small::Storage::kRows;
    double left = g[i] * s.scale[i];
    const int known = std::min(k, rank_);
    for (int j = 0; j < known; ++j) left -= L[j] * z[j];
    if (k < rank_) {
      z[k] = left;
    } else {
      const double length = std::sqrt(s.square[i]);
      inconsistency_[static_cast<std::size_t>(k)] =
          length > 0.0 ? std::abs(left) / length : std::abs(g[i]);
    }
  }
  kernel_->combine(s, rank_, z, metric_.data(), dy, n_);
}

// Computes du = A^T (A A^T)^-1 b over the rows that take part. The inconsistency of the others is
// their entry of |b - A du|.
void MinimumNorm::solve_kept(const double* g, double* dy) {
  double* z = large_->rhs.data();
  const int* order = large_->order.data();
  const double* to_unit = large_->to_unit.data();
  for (int k = 0; k < rank_; ++k) z[k] = g[order[k]] * to_unit[order[k]];
  large_->kept.solve(rank_, z, dy);
  for (int k = rank_; k < m_; ++k) {
    const int i = order[k];
    inconsistency_[static_cast<std::size_t>(k)] =
        std::abs(g[i] * to_unit[i] - large_->kept.times(i, dy));
  }
  for (int j = 0; j < n_; ++j) dy[j] *= metric_[static_cast<std::size_t>(j)];
}

void MinimumNorm::solve_orthogonal(const double* g, double* dy) {
  auto& qr = large_->qr;
  auto& work = large_->work;
  auto& rhs = large_->rhs;
  const auto& R = qr.matrixQR();
  for (int k = 0; k < rank_; ++k) rhs[k] = scaled(g, pivot(k));
  R.topLeftCorner(rank_, rank_)
      .triangularView<Eigen::Upper>()
      .transpose()
      .solveInPlace(rhs.head(rank_));
  for (int k = rank_; k < m_; ++k)
    inconsistency_[static_cast<std::size_t>(k)] =
        std::abs(scaled(g, pivot(k)) - R.col(k).head(rank_).dot(rhs.head(rank_)));

  Eigen::Map<Eigen::VectorXd> du(dy, n_);
  du.setZero();
  du.head(rank_) = rhs.head(rank_);
  for (int k = rank_ - 1; k >= 0; --k)
    du.tail(n_ - k).applyHouseholderOnTheLeft(R.col(k).tail(n_ - k - 1), qr.hCoeffs()[k],
                                              work.data());
  for (int j = 0; j < n_; ++j) dy[j] *= metric_[static_cast<std::size_t>(j)];
}

int MinimumNorm::pivot(int k) const {
  return kernel_ != nullptr ? small_->pivot[k] : large_->order[static_cast<std::size_t>(k)];
}

double MinimumNorm::row_norm(int i) const {
  return kernel_ != nullptr ? std::sqrt(small_->square[i]) / small_->scale[i]
                            : row_norm_[static_cast<std::size_t>(i)];
}

std::vector<double> MinimumNorm::dependence(int k) const {
  const int r = rank_;
  Eigen::VectorXd x(r);
  if (kernel_ != nullptr) {
    // a_k = L_k U and the kept rows are (I + L) U: x = (I + L)^-T L_k^T, then to unit rows.
    const small::Storage& s = *small_;
    const auto L = [&](int row, int step) {
      return s.L[s.pivot[row] * small::Storage::kRows + step];
    };
    for (int j = r - 1; j >= 0; --j) {
      x[j] = L(k, j);
      for (int i = j + 1; i < r; ++i) x[j] -= L(i, j) * x[i];
    }
    const auto length = [&](int row) { return std::sqrt(s.square[s.pivot[row]]); };
    for (int j = 0; j < r; ++j) x[j] *= length(j) / length(k);
  } else if (kept_) {
    large_->kept.dependence(pivot(k), r, x.data());
  } else if (large_->split) {
    return dependence_split(k);
  } else {
    x = large_->qr.matrixQR().col(k).head(r);
    large_->qr.matrixQR().topLeftCorner(r, r).triangularView<Eigen::Upper>().solveInPlace(x);
  }
  return {x.data(), x.data() + r};
}

double MinimumNorm::independent_part(int k) const {
  if (kernel_ != nullptr) return std::sqrt(small_->ratio[k]);
  if (kept_) return large_->kept.independent_part(k);
  return large_->split ? independent_part_split(k) : std::abs(large_->qr.matrixQR()(k, k));
}

double MinimumNorm::condition() const {
  double smallest = std::numeric_limits<double>::infinity(), largest = 0.0;
  for (int k = 0; k < rank_; ++k) {
    const double r = independent_part(k);
    smallest = std::min(smallest, r);
    largest = std::max(largest, r);
  }
  return rank_ == 0 ? std::numeric_limits<double>::infinity() : largest / smallest;
}

}  // namespace tether::linalg
