// Tether: unit rows that are known to be independent, and A A^T = L L^T of them.
// SPDX-License-Identifier: BSD-3-Clause
#include "kept_rows.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "small_orthogonal.hpp"

namespace tether::linalg {

void KeptRows::resize(int rows, int columns) {
  const auto entries = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  const auto each_column = static_cast<std::size_t>(columns);
  const int most = std::min(rows, columns);
  const auto each_row = static_cast<std::size_t>(most);
  n_ = columns;
  places_.resize(rows, columns);
  A_.assign(entries, 0.0);
  gathered_.assign(each_column, 0.0);
  heads_.assign(each_column, -1);
  links_.resize(static_cast<std::size_t>(kDense * static_cast<double>(entries)) + 1);
  work_.assign(each_column, 0.0);
  order_.clear();
  order_.reserve(each_row);
  place_.assign(each_row, 0);
  sorted_.assign(each_row, 0);
  groups_.assign(each_column, 0);
  firsts_.assign(each_column, 0);
  permuted_.assign(each_row, 0.0);
  envelope_.resize(most);
  planned_places_ = -1;
  L_.resize(most, most);
  spread_.resize(columns, most);
}

bool KeptRows::load(const double* wide, int width, const int* rows, const int* columns,
                    const double* D, double* row_norm) {
  const int m = n_ > 0 ? static_cast<int>(A_.size()) / n_ : 0;
  const bool adjacent = n_ > 0 && columns[n_ - 1] - columns[0] + 1 == n_;
  for (int i = 0; i < m; ++i) {
    const double* c = wide + static_cast<std::ptrdiff_t>(rows[i]) * width;
    if (adjacent) {
      c += columns[0];
    } else {
      for (int j = 0; j < n_; ++j) gathered_[static_cast<std::size_t>(j)] = c[columns[j]];
      c = gathered_.data();
    }
    places_.look(i, c);
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

bool KeptRows::factor(const int* order, int rank) {
  if (!planned(order, rank)) plan(order, rank);
  if (!dense_) {
    multiply_by_columns(rank);
    return envelope_.factor();
  }
  multiply_dense(rank);
  Eigen::Ref<Eigen::MatrixXd> L = L_.topLeftCorner(rank, rank);
  return Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(L).info() == Eigen::Success;
}

bool KeptRows::planned(const int* order, int rank) const {
  return planned_places_ == places_.known() && static_cast<int>(order_.size()) == rank &&
         std::equal(order_.begin(), order_.end(), order);
}

int KeptRows::group_of(int j) {
  int& root = groups_[static_cast<std::size_t>(j)];
  while (root != groups_[static_cast<std::size_t>(root)])
    root = groups_[static_cast<std::size_t>(root)];
  return root;
}

// Which rows belong together, and the envelope of A A^T, from the places alone.
void KeptRows::plan(const int* order, int rank) {
  planned_places_ = places_.known();
  order_.assign(order, order + rank);
  double entries = 0.0;
  for (const int i : order_) entries += static_cast<double>(places_.end(i) - places_.begin(i));
  dense_ = entries > kDense * rank * n_;
  if (dense_) return;

  std::iota(groups_.begin(), groups_.end(), 0);
  for (const int i : order_)
    for (const int *j = places_.begin(i), *last = places_.end(i); j != last; ++j)
      groups_[static_cast<std::size_t>(group_of(*j))] = group_of(*places_.begin(i));
  // A row without a place, as good as none among independent ones, comes first.
  const auto group = [this](int k) {
    const int i = order_[static_cast<std::size_t>(k)];
    return places_.begin(i) == places_.end(i) ? -1 : group_of(*places_.begin(i));
  };
  std::vector<int>& by_group = sorted_;
  std::iota(by_group.begin(), by_group.begin() + rank, 0);
  std::sort(by_group.begin(), by_group.begin() + rank, [&](int k, int l) {
    const int a = group(k), b = group(l);
    return a != b ? a < b : k < l;
  });
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
}

void KeptRows::spread(int i) const {
  visit(i, [this](int j, double a) { work_[static_cast<std::size_t>(j)] = a; });
}

void KeptRows::clear(int i) const {
  visit(i, [this](int j, double) { work_[static_cast<std::size_t>(j)] = 0.0; });
}

// Rows that share no column make no product.
void KeptRows::multiply_by_columns(int rank) {
  std::fill(heads_.begin(), heads_.end(), -1);
  envelope_.clear();
  int count = 0;
  for (int k = 0; k < rank; ++k)
    visit(sorted_[static_cast<std::size_t>(k)], [&](int j, double a) {
      int& head = heads_[static_cast<std::size_t>(j)];
      links_[static_cast<std::size_t>(count)] = {head, k, a};
      head = count++;
      for (int e = head; e >= 0; e = links_[static_cast<std::size_t>(e)].next) {
        const Link& before = links_[static_cast<std::size_t>(e)];
        envelope_.add(k, before.row, a * before.entry);
      }
    });
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

}  // namespace tether::linalg
