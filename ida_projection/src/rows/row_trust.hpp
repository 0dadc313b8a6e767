// Tether: which directions of C can be trusted (method, eq. 19). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/minimum_norm.hpp>
#include <vector>

namespace tether::ida_projection {

/// Rows that depend on each other on the set { g = 0 } do not off it: a distance d away they are
/// independent by kappa d, kappa the rate at which the unit rows of C D turn with y. What the
/// others leave of such a row's g is of order d^2, or round-off, and divided by kappa d it asks
/// for a move as long as d itself, or longer, in a direction that means nothing.
///
/// So a row counts only if its independent part is larger than what its direction changes by over
/// the move that the firm rows, those with |R_kk| >= kThin, ask for:
///
///     |R_kk| >= 2 kappa |dy| .
///
/// This costs one comparison where every row is firm.
class RowTrust {
 public:
  static constexpr double kThin = 1e-3;

  using Solver = linalg::MinimumNorm;

  static bool has_thin_rows(const Solver& solver) { return solver.least_square() < kThin * kThin; }
  static int firm_rows(const Solver& solver) { return rows_from(solver, kThin); }
  /// Only `trusted` of the thin rows count now: will that be so in the next steps, whatever their
  /// moves are? Only where all thin rows are left out, and none is independent enough to count
  /// whenever moves are short.
  static bool lasting(const Solver& solver, int firm, int trusted) {
    return trusted == firm && solver.independent_part(firm) <= kDependent;
  }
  /// Rows to be trusted for a move of this length (tolerances) by the firm rows.
  int trusted_rows(const Solver& solver, double length) const;

  /// Thin rows cannot be judged for a move of this length before C was looked at behind it.
  bool must_learn(double length) const { return kappa_ < 0.0 && length > kShort; }
  /// Is it time to look how C turns over a move of this length?
  bool wants_to_learn(double length);
  /// From C (row-major, n columns) before and after the move; rows, columns: those in the solver.
  void learn(Solver& solver, const std::vector<int>& rows, const std::vector<int>& columns, int n,
             const std::vector<double>& before, const std::vector<double>& after, double length);
  void reset() { *this = RowTrust(); }

 private:
  static constexpr double kDependent = 1e-5;
  static constexpr double kShort = 1e-3;  // tolerances: over less than that C does not turn visibly

  static int rows_from(const Solver& solver, double smallest) {
    int rank = solver.rank();
    while (rank > 0 && solver.independent_part(rank - 1) < smallest) --rank;
    return rank;
  }

  double kappa_ = -1.0;    // for each tolerance of length; < 0: not known yet
  double measured_ = 0.0;  // longest move over which it was looked for
  long candidates_ = 0;
};

}  // namespace tether::ida_projection
