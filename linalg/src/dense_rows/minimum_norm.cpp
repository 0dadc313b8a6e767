// Tether: minimum-norm solution of C dy = g in a diagonal metric.
// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tether/linalg/minimum_norm.hpp>

#include "small_kept_rows.hpp"

namespace tether::linalg {

namespace {

constexpr double kLeastShare = 1.0 / 3.0;  // of factor_kept()
// Factors of A A^T determine the square of a larger sine to a relative error of 1e-10.
constexpr double kLeastSine = 1e-3;
// A unit row of which less is left, 1 / sqrt(2), is orthogonalised twice, as Daniel, Gragg, Kaufman
// and Stewart have it (Math. Comp. 30 (1976) 772); "twice is enough": Parlett, The Symmetric
// Eigenvalue Problem, 6.9.
constexpr double kTwice = 0.7071067811865476;

// Computes |a| without overflow or underflow.
double careful_norm(const Eigen::Ref<const Eigen::RowVectorXd>& a) {
  return a.allFinite() ? a.stableNorm() : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

// P A = L Q, or A A^T = L L^T of the rows that take part.
struct MinimumNorm::Large {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static constexpr int kBlock = 4;  // entries of a row, as many as Eigen adds up side by side

  // Modified Gram-Schmidt, of rows the one of which most is left first; A becomes Q. Returns the
  // rank: of the next row no more than `tolerance` is left.
  int orthogonalise(double tolerance, std::vector<int>& order) {
    const auto m = static_cast<int>(A.rows());
    L.setZero();
    for (int i = 0; i < m; ++i) left[i] = A.row(i).squaredNorm();
    for (int k = 0; k < m; ++k) {
      Eigen::Index most = 0;
      left.tail(m - k).maxCoeff(&most);
      exchange(k, k + static_cast<int>(most), order);
      for (int i = 0; i < k && left[k] < kTwice * kTwice; ++i) take(k, i);
      const double length = A.row(k).norm();
      if (!(length > tolerance)) return k;
      L(k, k) = length;
      A.row(k) *= 1.0 / length;
      for (int i = k + 1; i < m; ++i)
        if (take(i, k)) left[i] = A.row(i).squaredNorm();
    }
    return m;
  }
  // Removes from row i its part along row k of Q. False: it has none.
  bool take(int i, int k) {
    const double share = A.row(k).dot(A.row(i));
    if (share == 0.0) return false;
    L(i, k) += share;
    A.row(i) -= share * A.row(k);
    return true;
  }
  void exchange(int i, int k, std::vector<int>& order) {
    if (i == k) return;
    A.row(i).swap(A.row(k));
    L.row(i).swap(L.row(k));
    std::swap(left[i], left[k]);
    std::swap(order[static_cast<std::size_t>(i)], order[static_cast<std::size_t>(k)]);
  }

  // Notes where row k of A has blocks that are not zero.
  void note_filled(int k) {
    const double* a = A.row(k).data();
    int count = 0;
    for (int e = 0; e + kBlock <= A.cols(); e += kBlock)
      if (a[e] != 0.0 || a[e + 1] != 0.0 || a[e + 2] != 0.0 || a[e + 3] != 0.0)
        filled(k, count++) = e;
    filled_blocks[k] = count;
  }
  // Row i of A times row k, with the bits of Eigen's product: zeros of row i are left out.
  double product(int i, int k) const {
    const double *a = A.row(i).data(), *b = A.row(k).data();
    double sum[kBlock] = {};
    for (int f = 0; f < filled_blocks[i]; ++f)
      for (int e = filled(i, f), l = 0; l < kBlock; ++l) sum[l] += a[e + l] * b[e + l];
    double low = sum[0] + sum[2], high = sum[1] + sum[3];
    Eigen::Index e = A.cols() / kBlock * kBlock;
    for (; e + 1 < A.cols(); e += 2) {
      low += a[e] * b[e];
      high += a[e + 1] * b[e + 1];
    }
    return e < A.cols() ? low + high + a[e] * b[e] : low + high;
  }

  // Returns the least L_kk of the first `rank` rows of A; 0 where A A^T is not positive definite.
  double factor(int rank) {
    double least = 1.0;
    for (int k = 0; k < rank; ++k) {
      note_filled(k);
      for (int j = 0; j < k; ++j)
        L(k, j) = (product(j, k) - L.row(k).head(j).dot(L.row(j).head(j))) / L(j, j);
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

  Rows A;  // unit rows, or those of Q; factored ones in pivot order
  Rows L;
  Eigen::VectorXd left, rhs;  // left: square of what is left of each row
  Eigen::Matrix<int, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> filled;  // note_filled()
  Eigen::VectorXi filled_blocks;
};

MinimumNorm::MinimumNorm() : large_(std::make_unique<Large>()) {}
MinimumNorm::MinimumNorm(int rows, int columns) : MinimumNorm() { resize(rows, columns); }
MinimumNorm::~MinimumNorm() = default;
MinimumNorm::MinimumNorm(MinimumNorm&&) noexcept = default;
MinimumNorm& MinimumNorm::operator=(MinimumNorm&&) noexcept = default;

void MinimumNorm::resize(int rows, int columns) {
  if (rows < 0 || columns < 0)
    throw std::invalid_argument("MinimumNorm::resize: rows = " + std::to_string(rows) +
                                ", columns = " + std::to_string(columns) + "; both must be >= 0");
  m_ = rows;
  n_ = columns;
  factors_ = Factors::orthogonal;
  rank_ = factored_rank_ = 0;
  least_square_ = 1.0;
  const auto m = static_cast<std::size_t>(rows);
  inconsistency_.assign(m, 0.0);
  row_norm_.assign(m, 0.0);
  metric_.assign(static_cast<std::size_t>(columns), 0.0);
  few_.reset();
  if (rows > 0 && rows <= small::KeptRows::kRows && columns <= small::KeptRows::kColumns) {
    few_ = std::make_unique<small::KeptRows>();
    few_->resize(rows);
    solve_few_ = few_->solve;
  }
  large_->A.resize(rows, columns);
  large_->left.resize(rows);
  large_->rhs.resize(rows);
  large_->L.resize(rows, rows);
  large_->filled.resize(rows, columns / Large::kBlock);
  large_->filled_blocks.resize(rows);
  order_.resize(m);
  std::iota(order_.begin(), order_.end(), 0);
}

double* MinimumNorm::row(int i) { return large_->A.row(i).data(); }

bool MinimumNorm::factor(const double* D, double rank_tolerance) {
  metric_.assign(D, D + n_);
  rank_ = factored_rank_ = 0;
  for (int i = 0; i < m_; ++i)
    if (!scale(i, i)) return false;
  factor_orthogonal(rank_tolerance);
  return true;
}

bool MinimumNorm::factor(const double* wide, int width, const int* rows, const int* columns,
                         double rank_tolerance) {
  rank_ = factored_rank_ = 0;
  for (int i = 0; i < m_; ++i) {
    gather(wide + static_cast<std::ptrdiff_t>(rows[i]) * width, columns, i);
    if (!scale(i, i)) return false;
  }
  factor_orthogonal(rank_tolerance);
  return true;
}

void MinimumNorm::gather(const double* c, const int* columns, int k) {
  double* a = large_->A.row(k).data();
  for (int j = 0; j < n_; ++j) a[j] = c[columns[j]];
}

// Turns row k of A, which is row i of C, into the unit row of C D. Returns false if an entry is not
// finite.
bool MinimumNorm::scale(int k, int i) {
  auto a = large_->A.row(k);
  a = a.cwiseProduct(Eigen::Map<const Eigen::RowVectorXd>(metric_.data(), n_));
  const double square = a.squaredNorm();
  const double length = square > 1e-280 && square < 1e280 ? std::sqrt(square) : careful_norm(a);
  if (!std::isfinite(length)) return false;
  row_norm_[static_cast<std::size_t>(i)] = length;
  a *= length > std::numeric_limits<double>::min() ? 1.0 / length : 0.0;
  return true;
}

bool MinimumNorm::factor_kept(const double* wide, int width, const int* rows, const int* columns) {
  if (rank_ == 0) return false;
  if (factors_ == Factors::orthogonal) {
    const double least = independent_part(rank_ - 1);
    least_sine_ = least < kLeastSine ? 0.0 : std::max(kLeastSine, kLeastShare * least);
  }
  if (least_sine_ == 0.0) return false;
  return few_ != nullptr ? factor_few(wide, width, rows, columns)
                         : factor_gram(wide, width, rows, columns);
}

// If it fails nothing is known of the rows any more.
bool MinimumNorm::factor_few(const double* wide, int width, const int* rows, const int* columns) {
  if (rank_ < m_) return false;
  const small::Gathered from{wide, width, rows, columns, metric_.data()};
  if (!few_->factor(*few_, from, order_.data(), m_, n_, least_sine_ * least_sine_)) {
    rank_ = factored_rank_ = 0;
    return false;
  }
  double least = 1.0;
  for (int k = 0; k < m_; ++k) least = few_->ratio[k] < least ? few_->ratio[k] : least;
  least_square_ = least;
  factors_ = Factors::few;
  return true;
}

bool MinimumNorm::factor_gram(const double* wide, int width, const int* rows, const int* columns) {
  const int r = rank_;
  rank_ = factored_rank_ = 0;
  for (int k = 0; k < m_; ++k) {
    const int i = pivot(k);
    gather(wide + static_cast<std::ptrdiff_t>(rows[i]) * width, columns, k);
    if (!scale(k, i)) return false;
  }
  const double least = large_->factor(r);
  if (!(least >= least_sine_)) return false;
  least_square_ = least * least;
  factors_ = Factors::gram;
  rank_ = factored_rank_ = r;
  return true;
}

void MinimumNorm::factor_orthogonal(double rank_tolerance) {
  factors_ = Factors::orthogonal;
  std::iota(order_.begin(), order_.end(), 0);
  rank_ = factored_rank_ = large_->orthogonalise(rank_tolerance, order_);
  least_square_ = rank_ > 0 ? std::pow(independent_part(rank_ - 1), 2) : 1.0;
}

double MinimumNorm::scaled(const double* g, int i) const {
  const double length = row_norm_[static_cast<std::size_t>(i)];
  return length > std::numeric_limits<double>::min() ? g[i] / length : g[i];
}

// Computes du = A^T (A A^T)^-1 b over the rows that take part. The inconsistency of the others is
// their entry of |b - A du|.
void MinimumNorm::solve_gram(const double* g, double* dy) {
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
  auto& z = large_->rhs;
  const auto& L = large_->L;
  for (int k = 0; k < m_; ++k) {
    double left = scaled(g, pivot(k));
    for (int i = 0; i < std::min(k, rank_); ++i) left -= L(k, i) * z[i];
    if (k < rank_)
      z[k] = left / L(k, k);
    else
      inconsistency_[static_cast<std::size_t>(k)] = std::abs(left);
  }
  Eigen::Map<Eigen::RowVectorXd> du(dy, n_);
  du.setZero();
  for (int k = 0; k < rank_; ++k) du += z[k] * large_->A.row(k);
  for (int j = 0; j < n_; ++j) dy[j] *= metric_[static_cast<std::size_t>(j)];
}

double MinimumNorm::row_norm(int i) const {
  return factors_ == Factors::few ? std::sqrt(few_->square[i])
                                  : row_norm_[static_cast<std::size_t>(i)];
}

std::vector<double> MinimumNorm::dependence(int k) const {
  const int r = rank_;
  Eigen::VectorXd x(r);
  if (factors_ == Factors::gram) {
    x = large_->A.topRows(r) * large_->A.row(k).transpose();
    large_->solve(r, x);
  } else {
    x = large_->L.row(k).head(r);
    large_->L.topLeftCorner(r, r).triangularView<Eigen::Lower>().transpose().solveInPlace(x);
  }
  return {x.data(), x.data() + r};
}

double MinimumNorm::independent_part(int k) const {
  return factors_ == Factors::few ? std::sqrt(few_->ratio[k]) : large_->L(k, k);
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
