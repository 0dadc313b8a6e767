// Tether: minimum-norm solution of C dy = g in a diagonal metric.
// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <stdexcept>
#include <string>
#include <tether/linalg/minimum_norm.hpp>

#include "small_kept_rows.hpp"
#include "small_orthogonal.hpp"

namespace tether::linalg {

namespace {

constexpr double kLeastShare = 1.0 / 3.0;  // of factor_kept()
// Factors of A A^T determine the square of a larger sine to a relative error of 1e-10.
constexpr double kLeastSine = 1e-3;

}  // namespace

// Factors of more rows than small_orthogonal.hpp takes: A^T P = Q R, or A A^T = L L^T of the rows
// that take part.
struct MinimumNorm::Large {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  // Returns the least L_kk of the first `rank` rows of A; 0 where A A^T is not positive definite.
  double factor(int rank) {
    double least = 1.0;
    for (int k = 0; k < rank; ++k) {
      for (int j = 0; j < k; ++j)
        L(k, j) = (A.row(k).dot(A.row(j)) - L.row(k).head(j).dot(L.row(j).head(j))) / L(j, j);
      const double square = A.row(k).squaredNorm() - L.row(k).head(k).squaredNorm();
      if (!(square > 0.0)) return 0.0;
      L(k, k) = std::sqrt(square);
      least = std::min(least, L(k, k));
    }
    return least;
  }
  // Overwrites z with (A A^T)^-1 z over the first `rank` rows.
  template <class Vector>
  void solve(int rank, Vector&& z) const {
    const auto factor = L.topLeftCorner(rank, rank).triangularView<Eigen::Lower>();
    factor.solveInPlace(z);
    factor.transpose().solveInPlace(z);
  }

  Rows A;  // unit rows; of factor_kept() in pivot order
  Rows L;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  Eigen::VectorXd work, rhs;
  std::vector<int> order;  // pivot order
};

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
    large_->L.resize(rows, rows);
    large_->order.assign(m, 0);
  }
}

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
    for (int i = 0; i < m_; ++i)
      if (!scale_large(i, i)) return false;
    return factor_orthogonal(rank_tolerance);
  }
  if (!kernel_->form_rows(*small_, m_, metric_.data())) return false;
  set_rank(kernel_->factor(*small_, m_, n_, rank_tolerance));
  return true;
}

bool MinimumNorm::factor(const double* wide, int width, const int* rows, const int* columns,
                         double rank_tolerance) {
  set_rank(0);
  kept_ = false;
  if (kernel_ != nullptr) {
    if (!kernel_->gather_rows(*small_, m_, n_, wide, width, rows, columns, metric_.data()))
      return false;
    set_rank(kernel_->factor(*small_, m_, n_, rank_tolerance));
    return true;
  }
  for (int i = 0; i < m_; ++i) {
    gather_large(wide + static_cast<std::ptrdiff_t>(rows[i]) * width, columns, i);
    if (!scale_large(i, i)) return false;
  }
  return factor_orthogonal(rank_tolerance);
}

void MinimumNorm::gather_large(const double* c, const int* columns, int k) {
  double* a = large_->A.row(k).data();
  for (int j = 0; j < n_; ++j) a[j] = c[columns[j]];
}

// Turns row k of A, which is row i of C, into the unit row of C D. Returns false if an entry is not
// finite.
bool MinimumNorm::scale_large(int k, int i) {
  auto a = large_->A.row(k);
  a = a.cwiseProduct(Eigen::Map<const Eigen::RowVectorXd>(metric_.data(), n_));
  const double square = a.squaredNorm();
  const double length =
      square > 1e-280 && square < 1e280 ? std::sqrt(square) : small::careful_norm(a.data(), n_);
  if (!std::isfinite(length)) return false;
  row_norm_[static_cast<std::size_t>(i)] = length;
  a *= length > std::numeric_limits<double>::min() ? 1.0 / length : 0.0;
  return true;
}

bool MinimumNorm::factor_kept(const double* wide, int width, const int* rows, const int* columns) {
  if (kernel_ != nullptr) return factor_kept_small({wide, width, rows, columns, metric_.data()});
  const int r = rank_;
  if (r == 0) return false;
  if (!kept_) decided_least_ = independent_part(r - 1);
  if (decided_least_ < kLeastSine) return false;
  kept_ = false;
  for (int k = 0; k < m_; ++k) {
    const int i = pivot(k);
    gather_large(wide + static_cast<std::ptrdiff_t>(rows[i]) * width, columns, k);
    if (!scale_large(k, i)) return false;
  }
  const double least = large_->factor(r);
  if (!(least >= std::max(kLeastSine, kLeastShare * decided_least_))) return false;
  kept_ = true;
  rank_ = factored_rank_ = r;
  least_square_ = least * least;
  return true;
}

bool MinimumNorm::factor_kept_small(const small::Gathered& from) {
  if (rank_ == 0 || rank_ < m_) return false;
  small::Storage& s = *small_;
  if (!kept_) {
    decided_least_ = independent_part(rank_ - 1);
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
    kernel_ != nullptr ? solve_small(g, dy) : kept_ ? solve_kept(g, dy) : solve_orthogonal(g, dy);
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
  auto z = large_->rhs.head(rank_);
  for (int k = 0; k < rank_; ++k) z[k] = scaled(g, pivot(k));
  large_->solve(rank_, z);
  Eigen::Map<Eigen::RowVectorXd> du(dy, n_);
  du.setZero();
  for (int k = 0; k < rank_; ++k) du += z[k] * large_->A.row(k);
  for (int k = rank_; k < m_; ++k)
    inconsistency_[static_cast<std::size_t>(k)] =
        std::abs(scaled(g, pivot(k)) - large_->A.row(k).dot(du));
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
    x = large_->A.topRows(r) * large_->A.row(k).transpose();
    large_->solve(r, x);
  } else {
    x = large_->qr.matrixQR().col(k).head(r);
    large_->qr.matrixQR().topLeftCorner(r, r).triangularView<Eigen::Upper>().solveInPlace(x);
  }
  return {x.data(), x.data() + r};
}

double MinimumNorm::independent_part(int k) const {
  if (kernel_ != nullptr) return std::sqrt(small_->ratio[k]);
  return kept_ ? large_->L(k, k) : std::abs(large_->qr.matrixQR()(k, k));
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
