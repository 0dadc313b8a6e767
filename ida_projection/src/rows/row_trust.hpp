// Tether: which directions of C can be trusted (method, eq. 19). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/linalg/minimum_norm.hpp>
#include <vector>

#include "host/rounding.hpp"

namespace tether::ida_projection {

/// Rows that are dependent on the set { g = 0 } are independent at a distance d from it, by an
/// angle kappa d; kappa is the rate at which the unit rows of C D turn with y (method, section 9).
/// The part of g of such a row that the others do not explain is of order d^2, or rounding. Divided
/// by kappa d it would cause a move as long as d, or longer, in a meaningless direction.
///
/// A row therefore takes part only if its independent part exceeds the change of its direction over
/// the move of the firm rows, those with |R_kk| >= kThin:
///
///     |R_kk| >= 2 kappa |dy| .
///
/// If every row is firm this costs one comparison.
class RowTrust {
 public:
  static constexpr double kThin = 1e-3;
  static constexpr double kDependent = 1e-5;

  using Solver = linalg::MinimumNorm;

  static bool has_thin_rows(const Solver& solver) { return solver.least_square() < kThin * kThin; }
  static int firm_rows(const Solver& solver) { return rows_from(solver, kThin); }
  /// Whether the number of `trusted` rows will be the same in the next steps, whatever their moves.
  /// It is if all thin rows are left out, and none is independent enough for short moves.
  static bool lasting(const Solver& solver, int firm, int trusted) {
    return trusted == firm && solver.independent_part(firm) <= kDependent;
  }
  /// Number of rows that take part for a move of this length (tolerances) of the firm rows.
  int trusted_rows(const Solver& solver, double length) const {
    return rows_from(solver, kappa_ < 0.0 ? kThin : std::min(kThin, kSafety * kappa_ * length));
  }

  /// Whether C must be evaluated after a move before thin rows can be judged.
  bool must_learn() const { return kappa_ < 0.0; }
  /// Whether the turn of C over a move of this length is to be measured.
  bool wants_to_learn(double length) {
    return kappa_ < 0.0 || length > 4.0 * measured_ || ++candidates_ % kMeasureEvery == 0;
  }
  /// From C (row-major, n columns) before and after the move; rows, columns: those in the solver.
  void learn(Solver& solver, const std::vector<int>& rows, const std::vector<int>& columns, int n,
             const std::vector<double>& before, const std::vector<double>& after, double length) {
    const double* D = solver.metric();
    double largest = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double norm = solver.row_norm(static_cast<int>(i));
      if (vanishes(norm)) continue;
      const auto first = static_cast<std::size_t>(rows[i]) * static_cast<std::size_t>(n);
      double sum = 0.0;
      for (std::size_t k = 0; k < columns.size(); ++k) {
        const std::size_t entry = first + static_cast<std::size_t>(columns[k]);
        const double change = (after[entry] - before[entry]) * D[k];
        sum += change * change;
      }
      largest = std::max(largest, std::sqrt(sum) / norm);
    }
    if (!std::isfinite(largest)) return;
    kappa_ = std::max(kappa_, largest / length);
    measured_ = std::max(measured_, length);
  }
  void reset() { *this = RowTrust(); }

 private:
  static constexpr double kSafety = 2.0;

  static int rows_from(const Solver& solver, double smallest) {
    int rank = solver.rank();
    while (rank > 0 && solver.independent_part(rank - 1) < smallest) --rank;
    return rank;
  }

  double kappa_ = -1.0;    // for each tolerance of length; < 0: not known yet
  double measured_ = 0.0;  // longest move over which it was measured
  long candidates_ = 0;
};

}  // namespace tether::ida_projection
