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
  std::vector<double> D, g, dy;
  bool adjacent = false;  // columns follow each other without a gap

  void resize() {
    solver.resize(static_cast<int>(rows.size()), static_cast<int>(columns.size()));
    D.assign(columns.size(), 0.0);
    g.assign(rows.size(), 0.0);
    dy.assign(columns.size(), 0.0);
    adjacent = !columns.empty() &&
               columns.back() - columns.front() + 1 == static_cast<int>(columns.size());
  }

  bool factor(const std::vector<double>& C, int n, double rank_tolerance) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      double* a = solver.row(static_cast<int>(i));
      const double* c = C.data() + static_cast<std::ptrdiff_t>(rows[i]) * n;
      if (adjacent)
        std::copy_n(c + columns.front(), columns.size(), a);
      else
        for (std::size_t k = 0; k < columns.size(); ++k) a[k] = c[columns[k]];
    }
    return solver.factor(D.data(), rank_tolerance);
  }

  void solve() { solver.solve(g.data(), dy.data()); }
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

  /// From C (m x n, row-major) and the metric in d.D and a.D. False: an entry is not finite.
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
