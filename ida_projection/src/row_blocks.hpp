// Tether: the rows of C split into those for differential and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <string>
#include <tether/linalg/minimum_norm.hpp>
#include <vector>

#include "evaluator.hpp"

namespace tether::ida_projection {

/// One set of rows solved for one set of columns.
struct Block {
  std::vector<int> rows, columns;
  linalg::MinimumNorm solver;
  std::vector<double> g, dy;
  int first = -1;  // of columns that follow each other without a gap; -1: they do not

  void resize() {
    solver.resize(static_cast<int>(rows.size()), static_cast<int>(columns.size()));
    g.assign(rows.size(), 0.0);
    dy.assign(columns.size(), 0.0);
    const bool adjacent = !columns.empty() &&
                          columns.back() - columns.front() + 1 == static_cast<int>(columns.size());
    first = adjacent ? columns.front() : -1;
  }

  double* D() { return solver.metric(); }
  bool factor(const std::vector<double>& C, int n, double rank_tolerance) {
    return solver.factor(C.data(), n, rows.data(), columns.data(), rank_tolerance);
  }

  void solve() { solver.solve(g.data(), dy.data()); }

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
};

/// C dy = g in minimum norm, in two stages: rows without algebraic variables ("A") move the
/// differential columns ("d"); then rows that contain algebraic variables ("B") are solved for
/// these columns ("a") alone, so that no position or velocity is bent to repair a multiplier.
/// Where no variable is algebraic, B is empty and this is one minimum-norm solve.
class RowBlocks {
 public:
  RowBlocks(const Constraints& constraints, int m, int n)
      : constraints_(constraints), m_(m), n_(n) {}

  Block d, a;
  std::vector<int> columns;  ///< every column that C can fill and that is free

  /// Finds A, B, d and a from the entries that C can fill: those not zero at y or at a point some
  /// tolerances away, so that a velocity that happens to be zero is not taken for a structural
  /// zero. `id`: 1 differential, 0 algebraic, null: none algebraic. `C` is work space.
  Status structure(Evaluator& evaluator, double t, const std::vector<double>& y,
                   const std::vector<double>& WT, const std::vector<bool>& hold, const double* id,
                   std::vector<double>& C);
  bool structured() const { return structured_; }

  /// From C (m x n, row-major) and the metric in d.D() and a.D(). False: an entry is not finite.
  bool factor(const std::vector<double>& C, double rank_tolerance);
  /// d.dy and a.dy for the values g, with the C that was factored.
  void solve(const std::vector<double>& g, const std::vector<double>& C);
  int rank() const { return d.solver.rank() + a.solver.rank(); }
  bool dropped_rows() const { return d.solver.dropped() > 0 || a.solver.dropped() > 0; }

  /// After solve(): do dropped rows ask for what the kept ones exclude? Up to what a tolerance-size
  /// move explains, they must follow from them. Fills message and rows() when they do not.
  bool contradict(const std::vector<double>& C, const std::vector<double>& WT);
  const std::vector<int>& rows() const { return contradicting_; }

  std::string message;

 private:
  const Constraints& constraints_;
  int m_, n_;
  bool structured_ = false;
  std::vector<int> contradicting_;
};

}  // namespace tether::ida_projection
