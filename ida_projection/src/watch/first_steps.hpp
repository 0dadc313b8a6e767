// Tether: doubts in rows and tolerances, in the first steps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <string>
#include <vector>

#include "host/corrector.hpp"
#include "host/ida.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// Of the terms of C y': what their sum may be at an invariant; the corrector knows y' better.
constexpr double kNoInvariant = 1e-2;
/// What to do about a row that F does not keep, at the end of a message.
constexpr const char* kRowAdvice =
    "; check the row, its constants and F, or give also the rows without which F does not keep it";

/// When C y' + g_t is taken for a fault of the row.
struct RowDoubt {
  double share;  ///< of its terms
  double felt;   ///< tolerances in one step: less may be noise of y'
  int steps;     ///< so many in a row, with one sign: noise changes it
};

/// Rows that F does not keep, wrong entries of C, tolerances above the solution.
class FirstSteps {
 public:
  static constexpr long kSteps =
      100;  ///< accepted steps in which rows and tolerances are looked at

  FirstSteps(const Constraints& constraints, Statistics& statistics)
      : constraints_(constraints), evaluator_(constraints, statistics) {}

  void reset();  ///< a new run starts
  /// After a successful move in the step after `steps` of size h; `corrected`: the corrector's
  /// ycor. Returns the fault found; empty: none.
  std::string look(const Candidate& candidate, const StepData& step, long steps, double h,
                   N_Vector corrected, const AlgebraicVariables& variables, Mover& mover,
                   Corrector& corrector);

 private:
  std::string look_at_tolerances(const Candidate& candidate, const StepData& step, double h,
                                 N_Vector corrected);
  std::string look_for_false_rows(const Candidate& candidate, const StepData& step, double h,
                                  N_Vector corrected, const double* id, Mover& mover,
                                  Corrector& corrector);
  std::string one_sided_row(double t);
  std::string false_row(int row, const RowDoubt& doubt, const StepData& step, double h,
                        Corrector& corrector);
  std::string wrong_entry(double t) const;

  const Constraints& constraints_;
  Evaluator evaluator_;
  Tangency tangency_;  // of the caller's rows
  // of each row, for each kind of doubt: steps in a row in which F did not seem to keep it
  std::vector<std::array<int, 2>> row_doubts_;
  std::vector<int> vanished_;          // steps in which a row of C was zero
  bool doubted_ = false;               // the last look at the rows met something
  int looks_ = 0, small_looks_ = 0;    // at doubts in rows; at a solution below its tolerances
  double largest_ = 0.0;               // size of the solution so far, in tolerances
  long searched_ = 0;                  // unknowns compared
  std::vector<double> point_, slope_;  // y and y' as the corrector left them
  std::vector<double> plus_, minus_, moved_;  // work space: g to both sides, and where
  OwnedVector work_;
};

}  // namespace tether::ida_projection
