// Tether: faults of rows and tolerances (method, section 9). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "constraints/evaluator.hpp"
#include "host/corrector.hpp"
#include "host/rounding.hpp"
#include "movers/rows_at.hpp"
#include "start/algebraic.hpp"
#include "step/attempt.hpp"

namespace tether::ida_projection {

/// Wrong entries of C, rows that F does not keep, that hold one side of their set or depend on each
/// other, and tolerances above the solution; on contiguous vectors. Texts name the fault; empty:
/// none was found, or g is not known there.
class RowFaults {
 public:
  RowFaults(const Constraints& constraints, Statistics& statistics)
      : constraints_(constraints), evaluator_(constraints, statistics) {}

  void reset();  ///< a new run starts
  /// Whether check() is due in the step after `steps` accepted ones: not while y' is that of the
  /// start.
  static bool are_checked(long steps) {
    return steps >= 2 && (steps <= kFirstSteps || steps % kMeasureEvery == 0);
  }
  /// After a successful move; `corrected`: the corrector's ycor.
  std::string check(const Candidate& candidate, const Attempt& attempt, N_Vector corrected,
                    const AlgebraicVariables& variables, RowsAt& rows, Corrector& corrector);
  /// Whether a row was named that F does not keep.
  bool false_row_found() const { return run_.false_row_found; }
  /// Names a row that would move only algebraic variables that F determines; empty: there is none.
  const std::string& idle_row() const { return run_.idle_row; }

  /// Names the entry of C that check_jacobian finds wrong, with the reason where that is a kink.
  std::string wrong_entry(double t, const std::vector<double>& y) const;
  /// Names the rows whose gradients, in tolerances WT, depend on each other.
  std::vector<std::string> dependent(double t, const std::vector<double>& y,
                                     const std::vector<double>& WT);

 private:
  static constexpr long kFirstSteps = 100;  // accepted ones, in which all of this is looked for

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
    long checks = 0, last_check = 2;  // into doubts in rows; the steps at the last one
    int small_solutions = 0;          // at a solution below its tolerances
    double largest = 0.0;             // size of the solution so far, in tolerances
    bool false_row_found = false;
    std::string idle_row;
    std::size_t searched = 0;  // unknowns compared
  };

  std::string compare_with_tolerances(const Corrected& at);
  std::string find_false_rows(const Corrected& at, RowsAt& rows);
  std::string find_one_sided_row(double t);
  bool refine_slope(const Corrected& at);
  std::string diagnose(std::size_t row, double noticed, const Corrected& at);
  bool value(double t, const std::vector<double>& y, std::vector<double>& g);
  bool rates(double t, const std::vector<double>& y, const std::vector<double>& yp);

  const Constraints& constraints_;
  Evaluator evaluator_;
  Run run_;
  Tangency tangency_;                      // of the caller's rows
  std::vector<double> point_, slope_;      // y and y' as the corrector left them
  std::vector<double> better_, better_p_;  // the same, nearer to what F asks for
  std::vector<double> moved_, here_, sides_[4], rates_;
  OwnedVector work_, base_, ycor_;
};

}  // namespace tether::ida_projection
