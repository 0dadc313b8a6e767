// Tether: the rows of C split into those for differential and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
#include "row_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::ida_projection {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
// A tolerance-size move could not have caused a larger contradiction.
constexpr double kContradiction = 0.5;

}  // namespace

Status RowBlocks::structure(Evaluator& evaluator, double t, const std::vector<double>& y0,
                            const std::vector<double>& WT, const std::vector<bool>& hold,
                            const double* id, std::vector<double>& C) {
  const auto n = static_cast<std::size_t>(n_);
  std::vector<char> filled(static_cast<std::size_t>(m_) * n, 0);
  std::vector<double> y = y0;
  std::vector<int> all(n);
  for (std::size_t j = 0; j < n; ++j) all[j] = static_cast<int>(j);
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1)
      for (std::size_t i = 0; i < n; ++i)
        y[i] += (0.7 + 0.6 * std::sin(1.0 + 3.7 * static_cast<double>(i))) *
                std::max(1e-3 * std::abs(y[i]), 10.0 * (WT[i] > 0.0 ? WT[i] : 1e-6));
    const Status status = evaluator.jacobian(t, y.data(), n_, WT.data(), all, C.data());
    if (status != Status::success && pass == 0) {
      message = evaluator.message();
      return status;
    }
    if (status == Status::success)
      for (std::size_t e = 0; e < filled.size(); ++e) filled[e] |= C[e] != 0.0;
  }

  evaluator.sensitive(t, y0.data(), n_, WT.data(), filled);

  const auto held = [&](std::size_t j) { return !hold.empty() && hold[j]; };
  const auto algebraic = [&](std::size_t j) { return id != nullptr && id[j] == 0.0; };
  const auto fills = [&](int i, std::size_t j) {
    return filled[static_cast<std::size_t>(i) * n + j] != 0;
  };

  std::vector<char> row_is_algebraic(static_cast<std::size_t>(m_), 0);
  std::vector<char> column_used(n, 0);
  for (int i = 0; i < m_; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (fills(i, j) && !held(j)) {
        column_used[j] = 1;
        if (algebraic(j)) row_is_algebraic[static_cast<std::size_t>(i)] = 1;
      }
  for (Block* block : {&d, &a}) {
    block->rows.clear();
    block->columns.clear();
  }
  for (int i = 0; i < m_; ++i)
    (row_is_algebraic[static_cast<std::size_t>(i)] ? a : d).rows.push_back(i);
  for (std::size_t j = 0; j < n; ++j)
    if (column_used[j]) (algebraic(j) ? a : d).columns.push_back(static_cast<int>(j));
  // More rows than algebraic columns to satisfy them with: all rows over all columns together.
  if (a.rows.size() > a.columns.size()) {
    for (int i : a.rows) d.rows.push_back(i);
    for (int j : a.columns) d.columns.push_back(j);
    std::sort(d.rows.begin(), d.rows.end());
    std::sort(d.columns.begin(), d.columns.end());
    a.rows.clear();
    a.columns.clear();
  }
  d.resize();
  a.resize();
  columns.clear();
  for (std::size_t j = 0; j < n; ++j)
    if (column_used[j]) columns.push_back(static_cast<int>(j));

  for (int i = 0; i < m_; ++i) {
    bool free = false;
    for (std::size_t j = 0; j < n; ++j) free = free || (fills(i, j) && !held(j));
    if (!free) {
      message = constraints_.name(i) + " depends on no component that is free to move";
      return Status::inconsistent;
    }
  }
  structured_ = true;
  return Status::success;
}

bool RowBlocks::factor(const std::vector<double>& C, double rank_tolerance) {
  for (Block* block : {&d, &a})
    if (!block->rows.empty() && !block->factor(C, n_, rank_tolerance)) return false;
  return true;
}

void RowBlocks::solve(const std::vector<double>& g, const std::vector<double>& C) {
  if (a.rows.empty()) {  // then d has every row, in order
    d.solver.solve(g.data(), d.dy.data());
    return;
  }
  for (std::size_t i = 0; i < d.rows.size(); ++i) d.g[i] = g[static_cast<std::size_t>(d.rows[i])];
  d.solve();
  for (std::size_t i = 0; i < a.rows.size(); ++i) {
    const double* c = C.data() + static_cast<std::ptrdiff_t>(a.rows[i]) * n_;
    double rest = g[static_cast<std::size_t>(a.rows[i])];
    for (std::size_t k = 0; k < d.columns.size(); ++k) rest -= c[d.columns[k]] * d.dy[k];
    a.g[i] = rest;
  }
  a.solve();
}

bool RowBlocks::contradict(const std::vector<double>& C, const std::vector<double>& WT) {
  for (Block* block : {&d, &a}) {
    const auto& solver = block->solver;
    for (int k = solver.rank(); k < static_cast<int>(block->rows.size()); ++k) {
      const int row = block->rows[static_cast<std::size_t>(solver.pivot(k))];
      const double norm = solver.row_norm(solver.pivot(k));
      double row_in_tolerances = 0.0;
      for (int j : block->columns) {
        const double c = C[static_cast<std::size_t>(row) * static_cast<std::size_t>(n_) +
                           static_cast<std::size_t>(j)] *
                         WT[static_cast<std::size_t>(j)];
        row_in_tolerances += c * c;
      }
      const bool vanished = !(norm > std::numeric_limits<double>::min());
      const double left = solver.inconsistency(k) * (vanished ? 1.0 : norm);
      const double allowed =
          vanished ? 1e-12
                   : kContradiction * std::sqrt(n_ * row_in_tolerances) + 1e2 * kEpsilon * norm;
      if (left <= allowed) continue;

      contradicting_ = {row};
      if (vanished) {
        message =
            constraints_.name(row) + ": the gradient vanishes although g = " + std::to_string(left);
        return true;
      }
      const std::vector<double> share = solver.dependence(k);
      for (int i = 0; i < solver.rank(); ++i)
        if (std::abs(share[static_cast<std::size_t>(i)]) > 1e-3)
          contradicting_.push_back(block->rows[static_cast<std::size_t>(solver.pivot(i))]);
      std::sort(contradicting_.begin(), contradicting_.end());
      message = "rows contradict each other:";
      for (int i : contradicting_)
        message += " " + std::to_string(i) + " (" + constraints_.name(i) + ")";
      message += "; a distance of " +
                 std::to_string(left / std::sqrt(n_ * std::max(row_in_tolerances, 1e-300))) +
                 " tolerances stays unsolved";
      return true;
    }
  }
  return false;
}

}  // namespace tether::ida_projection
