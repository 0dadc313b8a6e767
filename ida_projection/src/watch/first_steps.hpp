// Tether: checks of rows and tolerances in the first steps (method, section 9).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "host/owned_vector.hpp"
#include "host/rounding.hpp"
#include "movers/rows_at.hpp"
#include "start/algebraic.hpp"
#include "step/attempt.hpp"
#include "watch/row_faults.hpp"

namespace tether::ida_projection {

/// Rows that F does not keep, wrong entries of C, tolerances above the solution.
class FirstSteps {
 public:
  /// Number of accepted steps in which rows and tolerances are checked.
  static constexpr long kSteps = 100;

  FirstSteps(const Constraints& constraints, RowFaults& faults)
      : constraints_(constraints), faults_(faults) {}

  void reset();  ///< a new run starts
  /// Whether the step after `steps` accepted ones is checked.
  static bool are_checked(long steps) {
    return steps >= kSettled && (steps <= kSteps || steps % kMeasureEvery == 0);
  }
  /// Whether a row was named that F does not keep.
  bool false_row_found() const { return run_.false_row_found; }
  /// Names a row that would move only algebraic variables that F determines; empty: there is none.
  const std::string& idle_row() const { return run_.idle_row; }
  /// After a successful move; `corrected`: the corrector's ycor. Returns the fault found; empty:
  /// none.
  std::string check(const Candidate& candidate, const Attempt& attempt, N_Vector corrected,
                    const AlgebraicVariables& variables, RowsAt& rows, Corrector& corrector);

 private:
  static constexpr long kSettled = 2;  // accepted steps: before, y' is still that of the start

  // An attempt as the corrector left it.
  struct Corrected {
    const Candidate& candidate;
    const Attempt& attempt;
    N_Vector ycor;
    double span;  // of time, since the last check
    const double* id;
    Corrector& corrector;
  };
  struct Row {
    double sum = 0.0, span = 0.0;  // of C y' over time, and the time
    double verified = 0.0;         // what a better y' left of the sums so far
    double suspected = 0.0;        // rate that verified them at the last check; 0: none did
    double limit = 1.0;            // of the sum from which on it is verified
    int vanished = 0;              // steps in which its gradient was zero
  };
  struct Run {
    std::vector<Row> rows;
    long checks = 0, last_check = kSettled;  // into doubts in rows; the steps at the last one
    int small_solutions = 0;                 // at a solution below its tolerances
    double largest = 0.0;                    // size of the solution so far, in tolerances
    bool false_row_found = false;
    std::string idle_row;
    std::size_t searched = 0;  // unknowns compared
  };

  std::string compare_with_tolerances(const Corrected& at);
  std::string find_false_rows(const Corrected& at, RowsAt& rows);
  std::string find_one_sided_row(double t);
  bool refine_slope(const Corrected& at);
  std::string diagnose(int row, double noticed, const Corrected& at);
  bool may_search() const { return faults_.may_search(run_.searched + point_.size()); }

  const Constraints& constraints_;
  RowFaults& faults_;
  Run run_;
  Tangency tangency_;                      // of the caller's rows
  std::vector<double> point_, slope_;      // y and y' as the corrector left them
  std::vector<double> better_, better_p_;  // the same, nearer to what F asks for
  std::vector<double> rates_;
  OwnedVector work_, base_, ycor_;
};

}  // namespace tether::ida_projection
