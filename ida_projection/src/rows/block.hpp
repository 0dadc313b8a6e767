// Tether: one set of rows solved for one set of columns. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

#include "host/rounding.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

/// `Solver`: linalg::MinimumNorm or SparseMinimumNorm.
template <class Solver>
struct BlockOf {
  std::vector<int> rows, columns;
  Solver solver;
  std::vector<double> g, dy;
  double least_independent = 1.0;  // sine of the angle of a row with those before it
  int first = -1;  // of columns that follow each other without a gap; -1: they do not

  /// After rows, columns and the solver were set up.
  void resize() {
    g.assign(rows.size(), 0.0);
    dy.assign(columns.size(), 0.0);
    const bool adjacent = !columns.empty() &&
                          columns.back() - columns.front() + 1 == static_cast<int>(columns.size());
    first = adjacent ? columns.front() : -1;
  }

  double* D() { return solver.metric(); }

  /// body(k, j) for each column j = columns[k]. Adjacent columns make a plain loop, which the
  /// compiler can turn into vector code.
  template <class Body>
  void for_columns(Body&& body) const {
    const int count = static_cast<int>(columns.size());
    if (first >= 0) {
      for (int k = 0; k < count; ++k) body(k, first + k);
    } else {
      for (int k = 0; k < count; ++k) body(k, columns[static_cast<std::size_t>(k)]);
    }
  }
  bool contains(int j) const {
    if (first >= 0) return j >= first && j < first + static_cast<int>(columns.size());
    return std::binary_search(columns.begin(), columns.end(), j);
  }
};

/// Dropped rows of a block that contradict its kept rows.
struct Contradiction {
  std::vector<int> rows;
  std::string message;
};

/// Part of a tolerance: a move of that size cannot make rows contradict each other by more.
constexpr double kContradiction = 0.5;

/// The dropped row, k in pivot order, that asks for most beyond the kept ones, in tolerances. Up to
/// what a move of the size of a tolerance explains it must follow from them.
struct LeftOfDropped {
  double tolerances = 0.0;
  int k = -1;
};

/// After solve(). in_tolerances(row): |row_i(C WT)| over the block's columns. n: unknowns.
template <class Solver, class Norm>
LeftOfDropped most_left_of_dropped(const BlockOf<Solver>& block, int n, Norm in_tolerances) {
  const Solver& solver = block.solver;
  LeftOfDropped most;
  for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k) {
    const double norm = solver.row_norm(solver.pivot(k));
    const bool vanished = !(norm > std::numeric_limits<double>::min());
    const double inconsistency =
        std::max(0.0, solver.inconsistency(k) - (vanished ? 0.0 : 1e2 * kEpsilon));
    if (inconsistency == 0.0) continue;
    // A row that vanishes has no distance: so much of its g is tolerated.
    const double row = in_tolerances(block.rows[static_cast<std::size_t>(solver.pivot(k))]);
    const double weight = vanished
                              ? kContradiction * 1e12
                              : norm / std::max(row, 1e-300) / std::sqrt(static_cast<double>(n));
    const double left = inconsistency * weight;
    if (left > most.tolerances) most = {left, k};
  }
  return most;
}

/// The rows that this one contradicts, for the caller.
template <class Solver>
Contradiction contradiction_of(const BlockOf<Solver>& block, const LeftOfDropped& left,
                               const Constraints& constraints) {
  const Solver& solver = block.solver;
  const int row = block.rows[static_cast<std::size_t>(solver.pivot(left.k))];
  Contradiction found{{row}, {}};
  if (!(solver.row_norm(solver.pivot(left.k)) > std::numeric_limits<double>::min())) {
    found.message = constraints.name(row) +
                    ": the gradient vanishes although g = " + brief(solver.inconsistency(left.k));
    return found;
  }
  const std::vector<double> share = solver.dependence(left.k);
  for (int i = 0; i < solver.rank(); ++i)
    if (std::abs(share[static_cast<std::size_t>(i)]) > 1e-3)
      found.rows.push_back(block.rows[static_cast<std::size_t>(solver.pivot(i))]);
  std::sort(found.rows.begin(), found.rows.end());
  found.message = "rows contradict each other:";
  for (int i : found.rows)
    found.message += " " + std::to_string(i) + " (" + constraints.name(i) + ")";
  found.message += "; a distance of " + brief(left.tolerances) + " tolerances stays unsolved";
  return found;
}

}  // namespace tether::ida_projection
