// Tether: unit rows that are known to be independent, and A A^T = L L^T of them.
// SPDX-License-Identifier: BSD-3-Clause
#include "kept_rows.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/filled.hpp>

#include "small_orthogonal.hpp"

namespace tether::linalg {

void KeptRows::resize(int rows, int columns) {
  const auto entries = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  n_ = columns;
  starts_.assign(static_cast<std::size_t>(rows) + 1, 0);
  columns_.assign(entries, 0);
  entries_.assign(entries, 0.0);
  heads_.assign(static_cast<std::size_t>(columns), -1);
  links_.resize(entries);
  work_.assign(static_cast<std::size_t>(columns), 0.0);
  const int most = std::min(rows, columns);
  L_.resize(most, most);
  spread_.resize(columns, most);
}

bool KeptRows::load(const double* wide, int width, const int* rows, const int* columns,
                    const double* D, double* row_norm) {
  const int m = static_cast<int>(starts_.size()) - 1;
  const bool adjacent = n_ > 0 && columns[n_ - 1] - columns[0] + 1 == n_;
  int count = 0;
  for (int i = 0; i < m; ++i) {
    const double* c = wide + static_cast<std::ptrdiff_t>(rows[i]) * width;
    const int first = count;
    double square = 0.0;
    const auto add = [&](int j, double entry) {
      const double scaled = entry * D[j];
      square += scaled * scaled;
      columns_[static_cast<std::size_t>(count)] = j;
      entries_[static_cast<std::size_t>(count++)] = scaled;
    };
    if (adjacent) {
      visit_filled(c + columns[0], n_, add);
    } else {
      for (int j = 0; j < n_; ++j)
        if (c[columns[j]] != 0.0) add(j, c[columns[j]]);
    }
    double* a = entries_.data() + first;
    const double length = square > 1e-280 && square < 1e280 ? std::sqrt(square)
                                                            : small::careful_norm(a, count - first);
    if (!std::isfinite(length)) return false;
    row_norm[i] = length;
    const double factor = length > std::numeric_limits<double>::min() ? 1.0 / length : 0.0;
    for (int e = 0; e < count - first; ++e) a[e] *= factor;
    starts_[static_cast<std::size_t>(i) + 1] = count;
  }
  return true;
}

bool KeptRows::factor(const int* order, int rank) {
  order_ = order;
  double entries = 0.0;
  for (int k = 0; k < rank; ++k) {
    const auto row = static_cast<std::size_t>(order[k]);
    entries += starts_[row + 1] - starts_[row];
  }
  if (entries <= kDense * rank * n_) {
    multiply_sparse(rank);
    return factor_sparse(rank);
  }
  multiply_dense(rank);
  Eigen::Ref<Eigen::MatrixXd> L = L_.topLeftCorner(rank, rank);
  return Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(L).info() == Eigen::Success;
}

void KeptRows::spread(int i) const {
  visit(i, [this](int j, double a) { work_[static_cast<std::size_t>(j)] = a; });
}

void KeptRows::clear(int i) const {
  visit(i, [this](int j, double) { work_[static_cast<std::size_t>(j)] = 0.0; });
}

// Rows that share no column make no product.
void KeptRows::multiply_sparse(int rank) {
  std::fill(heads_.begin(), heads_.end(), -1);
  int place = 0;
  for (int k = rank - 1; k >= 0; --k) {
    L_.col(k).segment(k, rank - k).setZero();
    visit(order_[k], [&](int j, double a) {
      int& head = heads_[static_cast<std::size_t>(j)];
      links_[static_cast<std::size_t>(place)] = {head, k, a};
      head = place++;
      for (int e = head; e >= 0; e = links_[static_cast<std::size_t>(e)].next) {
        const Link& below = links_[static_cast<std::size_t>(e)];
        L_(below.row, k) += a * below.entry;
      }
    });
  }
}

void KeptRows::multiply_dense(int rank) {
  spread_.leftCols(rank).setZero();
  for (int k = 0; k < rank; ++k) visit(order_[k], [&](int j, double a) { spread_(j, k) = a; });
  Eigen::Ref<Eigen::MatrixXd> L = L_.topLeftCorner(rank, rank);
  L.setZero();
  L.selfadjointView<Eigen::Lower>().rankUpdate(spread_.leftCols(rank).transpose());
}

// Column by column; columns that are zero in row j are skipped.
bool KeptRows::factor_sparse(int rank) {
  for (int j = 0; j < rank; ++j) {
    const int rest = rank - j;
    auto column = L_.col(j).segment(j, rest);
    for (int k = 0; k < j; ++k)
      if (L_(j, k) != 0.0) column.noalias() -= L_(j, k) * L_.col(k).segment(j, rest);
    const double square = L_(j, j);
    if (!(square > 0.0)) return false;
    const double part = std::sqrt(square);
    L_(j, j) = part;
    L_.col(j).segment(j + 1, rest - 1) *= 1.0 / part;
  }
  return true;
}

double KeptRows::times(int i, const double* du) const {
  double sum = 0.0;
  visit(i, [&](int j, double a) { sum += a * du[j]; });
  return sum;
}

void KeptRows::solve_factored(int rank, double* z) const {
  Eigen::Map<Eigen::VectorXd> right(z, rank);
  const auto L = L_.topLeftCorner(rank, rank).triangularView<Eigen::Lower>();
  L.solveInPlace(right);
  L.adjoint().solveInPlace(right);
}

void KeptRows::solve(int rank, double* z, double* du) const {
  solve_factored(rank, z);
  std::fill(du, du + n_, 0.0);
  for (int k = 0; k < rank; ++k) {
    const double share = z[k];
    visit(order_[k], [du, share](int j, double a) { du[j] += share * a; });
  }
}

void KeptRows::dependence(int i, int rank, double* x) const {
  spread(i);
  for (int k = 0; k < rank; ++k) x[k] = times(order_[k], work_.data());
  clear(i);
  solve_factored(rank, x);
}

}  // namespace tether::linalg
