// Tether: unit rows that are known to be independent, and A A^T = L L^T of them.
// SPDX-License-Identifier: BSD-3-Clause
#include "kept_rows.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "small_orthogonal.hpp"

namespace tether::linalg {

void KeptRows::resize(int rows, int columns) {
  const auto entries = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  const auto each_column = static_cast<std::size_t>(columns);
  const auto each_row = static_cast<std::size_t>(rows);
  n_ = columns;
  places_.resize(rows, columns);
  last_check_ = -1;
  A_.assign(entries, 0.0);
  gathered_.assign(each_column, 0.0);
  heads_.assign(each_column, -1);
  links_.resize(static_cast<std::size_t>(kDense * static_cast<double>(entries)) + 1);
  work_.assign(each_column, 0.0);
  order_.clear();
  order_.reserve(each_row);
  place_.assign(each_row, 0);
  sorted_.assign(each_row, 0);
  row_order_.resize(rows, columns);
  firsts_.assign(each_column, 0);
  permuted_.assign(each_row + 3, 0.0);
  envelope_.resize(rows);
  planned_places_ = -1;
  L_.resize(rows, rows);
  spread_.resize(columns, rows);
}

bool KeptRows::load(const double* wide, int width, const int* rows, const int* columns,
                    const double* D, double* row_norm, const FilledPlaces* places) {
  const int m = n_ > 0 ? static_cast<int>(A_.size()) / n_ : 0;
  if (m > 0 && places != nullptr && places->known() != last_check_)
    learn(*places, width, rows, columns);
  const bool adjacent = n_ > 0 && columns[n_ - 1] - columns[0] + 1 == n_;
  for (int i = 0; i < m; ++i) {
    const double* c = wide + static_cast<std::ptrdiff_t>(rows[i]) * width;
    if (adjacent) {
      c += columns[0];
    } else {
      for (int j = 0; j < n_; ++j) gathered_[static_cast<std::size_t>(j)] = c[columns[j]];
      c = gathered_.data();
    }
    if (places == nullptr) places_.note(i, c);
    double square = 0.0;
    double* const a = A_.data() + static_cast<std::ptrdiff_t>(i) * n_;
    int count = 0;
    for (const int *j = places_.begin(i), *last = places_.end(i); j != last; ++j) {
      const double scaled = c[*j] * D[*j];
      square += scaled * scaled;
      a[count++] = scaled;
    }
    const double length =
        square > 1e-280 && square < 1e280 ? std::sqrt(square) : small::careful_norm(a, count);
    if (!std::isfinite(length)) return false;
    row_norm[i] = length;
    const double factor = length > std::numeric_limits<double>::min() ? 1.0 / length : 0.0;
    for (int e = 0; e < count; ++e) a[e] *= factor;
  }
  return true;
}

// Takes over all places known to the caller, also those that are zero in every C seen here.
void KeptRows::learn(const FilledPlaces& wide, int width, const int* rows, const int* columns) {
  const int m = static_cast<int>(A_.size()) / n_;
  marks_.assign(static_cast<std::size_t>(width), 0.0);
  for (int i = 0; i < m; ++i) {
    for (const int *j = wide.begin(rows[i]), *last = wide.end(rows[i]); j != last; ++j)
      marks_[static_cast<std::size_t>(*j)] = 1.0;
    for (int j = 0; j < n_; ++j)
      gathered_[static_cast<std::size_t>(j)] = marks_[static_cast<std::size_t>(columns[j])];
    places_.note(i, gathered_.data());
    wide.clear(rows[i], marks_.data());
  }
  last_check_ = wide.known();
}

void KeptRows::load(const double* unit_rows) {
  const int m = n_ > 0 ? static_cast<int>(A_.size()) / n_ : 0;
  for (int i = 0; i < m; ++i) {
    const double* c = unit_rows + static_cast<std::ptrdiff_t>(i) * n_;
    double* a = A_.data() + static_cast<std::ptrdiff_t>(i) * n_;
    places_.note(i, c);
    for (const int *j = places_.begin(i), *last = places_.end(i); j != last; ++j) *a++ = c[*j];
  }
}

bool KeptRows::factor(const int* order, int rank) {
  if (!planned(order, rank)) plan(order, rank);
  if (!dense_) {
    multiply_by_columns(rank);
    return envelope_.factor();
  }
  return factor_dense(rank);
}

bool KeptRows::factor_dense(int rank) {
  multiply_dense(rank);
  Eigen::Ref<Eigen::MatrixXd> L = L_.topLeftCorner(rank, rank);
  return Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(L).info() == Eigen::Success;
}

bool KeptRows::factor_firm(const int* order, int rank, double sine) {
  if (!planned(order, rank)) plan(order, rank);
  if (dense_) return rank <= n_ && factor_dense(rank) && least_part(rank) >= sine;
  multiply_by_columns(rank);
  return envelope_.factor(sine * sine);
}

bool KeptRows::planned(const int* order, int rank) const {
  return planned_places_ == places_.known() && static_cast<int>(order_.size()) == rank &&
         std::equal(order_.begin(), order_.end(), order);
}

// Finds the order of the factors and the envelope of A A^T, which depend on the places alone.
void KeptRows::plan(const int* order, int rank) {
  planned_places_ = places_.known();
  order_.assign(order, order + rank);
  double entries = 0.0;
  for (const int i : order_) entries += static_cast<double>(places_.end(i) - places_.begin(i));
  dense_ = entries > kDense * rank * n_;
  if (dense_) return;

  row_order_.run(places_, order, rank, sorted_.data());
  envelope_.begin();
  std::fill(firsts_.begin(), firsts_.end(), -1);  // of each column: the first row that has it
  for (int k = 0; k < rank; ++k) {
    int& row = sorted_[static_cast<std::size_t>(k)];
    place_[static_cast<std::size_t>(row)] = k;
    row = order_[static_cast<std::size_t>(row)];
    int first = k;
    for (const int *j = places_.begin(row), *last = places_.end(row); j != last; ++j) {
      int& owner = firsts_[static_cast<std::size_t>(*j)];
      if (owner < 0) owner = k;
      first = std::min(first, owner);
    }
    envelope_.add_row(first);
  }
  envelope_.plan();
}

void KeptRows::spread(int i) const {
  visit(i, [this](int j, double a) { work_[static_cast<std::size_t>(j)] = a; });
}

void KeptRows::clear(int i) const {
  visit(i, [this](int j, double) { work_[static_cast<std::size_t>(j)] = 0.0; });
}

// Forms A A^T column by column of A: rows that share no column cost nothing.
void KeptRows::multiply_by_columns(int rank) {
  std::fill(heads_.begin(), heads_.end(), -1);
  envelope_.clear();
  int count = 0;
  Link* const links = links_.data();
  for (int k = 0; k < rank; ++k) {
    double* const products = envelope_.row(k);
    visit(sorted_[static_cast<std::size_t>(k)], [&](int j, double a) {
      int& head = heads_[static_cast<std::size_t>(j)];
      links[count] = {head, Envelope::kStride * k, a};
      for (int e = head; e >= 0; e = links[e].next) products[links[e].at] += a * links[e].entry;
      products[Envelope::kStride * k] += a * a;
      head = count++;
    });
  }
}

void KeptRows::multiply_dense(int rank) {
  spread_.leftCols(rank).setZero();
  for (int k = 0; k < rank; ++k)
    visit(order_[static_cast<std::size_t>(k)], [&](int j, double a) { spread_(j, k) = a; });
  Eigen::Ref<Eigen::MatrixXd> L = L_.topLeftCorner(rank, rank);
  L.setZero();
  L.selfadjointView<Eigen::Lower>().rankUpdate(spread_.leftCols(rank).transpose());
}

double KeptRows::least_part(int rank) const {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < rank; ++k) {
    const double part = independent_part(k);
    if (!(part >= least)) least = part;
  }
  return least;
}

double KeptRows::times(int i, const double* du) const {
  double sum = 0.0;
  visit(i, [&](int j, double a) { sum += a * du[j]; });
  return sum;
}

void KeptRows::solve_factored(int rank, double* z) const {
  if (dense_) {
    Eigen::Map<Eigen::VectorXd> right(z, rank);
    const auto L = L_.topLeftCorner(rank, rank).triangularView<Eigen::Lower>();
    L.solveInPlace(right);
    L.adjoint().solveInPlace(right);
    return;
  }
  for (int k = 0; k < rank; ++k)
    permuted_[static_cast<std::size_t>(place_[static_cast<std::size_t>(k)])] = z[k];
  envelope_.solve(permuted_.data());
  for (int k = 0; k < rank; ++k)
    z[k] = permuted_[static_cast<std::size_t>(place_[static_cast<std::size_t>(k)])];
}

void KeptRows::solve(int rank, double* z, double* du) const {
  solve_factored(rank, z);
  std::fill(du, du + n_, 0.0);
  for (int k = 0; k < rank; ++k) {
    const double share = z[k];
    visit(order_[static_cast<std::size_t>(k)],
          [du, share](int j, double a) { du[j] += share * a; });
  }
}

void KeptRows::dependence(int i, int rank, double* x) const {
  spread(i);
  for (int k = 0; k < rank; ++k) x[k] = times(order_[static_cast<std::size_t>(k)], work_.data());
  clear(i);
  solve_factored(rank, x);
}

// Projects twice: the first projection leaves rounding, magnified by the condition of A A^T.
void KeptRows::remainder(int i, int rank, double* z, double* left) const {
  std::fill(left, left + n_, 0.0);
  visit(i, [left](int j, double a) { left[j] = a; });
  for (int pass = 0; pass < 2; ++pass) {
    for (int k = 0; k < rank; ++k) z[k] = times(order_[static_cast<std::size_t>(k)], left);
    solve_factored(rank, z);
    for (int k = 0; k < rank; ++k) {
      const double share = z[k];
      visit(order_[static_cast<std::size_t>(k)],
            [left, share](int j, double a) { left[j] -= share * a; });
    }
  }
}

}  // namespace tether::linalg
