// Tether: checks of rows and tolerances in the first steps (method, section 9).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "host/corrector.hpp"
#include "host/ida.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// At an invariant the terms of C y' cancel to less than this part of their size.
constexpr double kNoInvariant = 1e-2;
/// Advice about a row that F does not keep, at the end of a message.
constexpr const char* kRowAdvice =
    "; check the row, its constants and F, or give also the rows without which F does not keep it";

/// Rows that F does not keep, wrong entries of C, tolerances above the solution.
class FirstSteps {
 public:
  /// Number of accepted steps in which rows and tolerances are checked.
  static constexpr long kSteps = 100;

  FirstSteps(const Constraints& constraints, Statistics& statistics)
      : constraints_(constraints), evaluator_(constraints, statistics) {}

  void reset();  ///< a new run starts
  /// Whether the step after `steps` accepted ones is checked.
  static bool looks(long steps) {
    return steps >= kSettled && (steps <= kSteps || steps % kEvery == 0);
  }
  /// Whether a row was named that F does not keep.
  bool false_row_found() const { return false_row_found_; }
  /// Names a row that would move only algebraic variables that F determines; empty: there is none.
  const std::string& idle_row() const { return idle_row_; }
  /// After a successful move in the step after `steps` of size h; `corrected`: the corrector's
  /// ycor. Returns the fault found; empty: none.
  std::string check(const Candidate& candidate, const StepData& step, long steps, double h,
                    N_Vector corrected, const AlgebraicVariables& variables, Mover& mover,
                    Corrector& corrector);

 private:
  static constexpr long kSettled = 2;  // accepted steps: before, y' is still that of the start
  static constexpr long kEvery = 16;   // steps, after the first ones

  std::string compare_with_tolerances(const Candidate& candidate, const StepData& step, double h,
                                      N_Vector corrected);
  std::string find_false_rows(const Candidate& candidate, const StepData& step, double h,
                              N_Vector corrected, const double* id, Mover& mover,
                              Corrector& corrector);
  void allocate(const Candidate& candidate);
  std::string one_sided_row(double t);
  struct Change {
    double sum = 0.0, span = 0.0;  // of C y' over time, and the time
    double verified = 0.0;         // what a better y' left of the sums so far
    double limit = 1.0;            // of the sum from which on it is verified
  };
  bool refine_slope(const Candidate& candidate, const StepData& step, const double* id,
                    N_Vector ycor, Corrector& corrector);
  double fastest(double t) const;
  double rate_along(int row, double t);
  std::string false_row(int row, Change& change, double noticed, const Candidate& candidate,
                        const StepData& step, const double* id, N_Vector corrected,
                        Corrector& corrector);

  const Constraints& constraints_;
  Evaluator evaluator_;
  Tangency tangency_;                 // of the caller's rows
  std::vector<Change> changes_;       // of each row, since it was looked into
  std::vector<int> vanished_;         // steps in which a row of C was zero
  long checks_ = 0, last_check_ = 0;  // into doubts in rows; the steps at the last look
  int small_solutions_ = 0;           // at doubts in rows; at a solution below its tolerances
  double largest_ = 0.0;              // size of the solution so far, in tolerances
  bool false_row_found_ = false;
  std::string idle_row_;
  long searched_ = 0;                  // unknowns compared
  std::vector<double> point_, slope_;  // y and y' as the corrector left them
  std::vector<double> moved_, kept_point_, kept_slope_, values_;  // work space
  OwnedVector work_, base_, ycor_;
};

}  // namespace tether::ida_projection
