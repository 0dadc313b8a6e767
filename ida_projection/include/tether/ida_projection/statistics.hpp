// Tether: constraint projection for SUNDIALS IDA. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <iosfwd>
#include <string>
#include <tether/export.hpp>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// Work counts and sizes since attach (or Projection::reset_statistics). A value: copy it freely.
struct Statistics {
  long solver_calls = 0;          ///< calls of the decorated nonlinear solver by IDA
  long steps_without_plugin = 0;  ///< IDA took them with another nonlinear solver, see never_called
  long projections = 0;           ///< steps (attempts) that were projected
  long skipped = 0;               ///< attempts already on the constraints, nothing moved
  long iterations = 0;            ///< Newton moves, and solutions for what rounding asks for
  long value_evaluations = 0;     ///< g
  long jacobian_evaluations = 0;  ///< C, however formed
  long joint_evaluations = 0;     ///< of both: g and C by one call, where rows have such a function
  long factorizations = 0;        ///< of C in the metric, with a decision on its rank
  long refactorizations = 0;      ///< of the rows that an earlier one has kept
  long extra_iterations = 0;      ///< polishes that changed differential variables
  long corrections_repeated =
      0;               ///< corrections redone with a new Jacobian: the stale one misled IDA
  long refreshes = 0;  ///< polishes that changed algebraic variables
  long residual_evaluations = 0;  ///< F called by the plugin itself (also in IDA's own count)
  long rank_drops = 0;            ///< factorisations that dropped redundant rows
  long untested = 0;  ///< algebraic variables out of IDA's error test, see suppress_algebraic
  long smoothing_begun = 0;          ///< runs in which Advanced::smooth_where_needed acted
  long order_limited = 0;            ///< times that Advanced::limit_order acted
  long sensitivity_projections = 0;  ///< steps (attempts) whose sensitivities were projected

  // Failures by kind; each makes IDA retry with a smaller step unless noted.
  long not_converged = 0;         ///< too many moves, stagnation or divergence
  long move_too_long = 0;         ///< longer than Advanced::largest_move (rejected)
  long moves_capped = 0;          ///< shortened by LongMove::cap; not a failure
  long inconsistent = 0;          ///< rows contradict each other
  long not_finite = 0;            ///< NaN or infinity in g, C or y
  long callback_recoverable = 0;  ///< a callback returned > 0
  long callback_fatal = 0;        ///< a callback returned < 0 or threw; ends the run
  long corrector_failures = 0;    ///< the decorated solver itself failed; not projected

  double largest_drift_before = 0.0;  ///< largest |g_i| that the corrector left
  double largest_drift_after = 0.0;   ///< largest |g_i| left, measured on every 16th projection
  double largest_move = 0.0;          ///< in tolerances (WRMS)
  double mean_move = 0.0;             ///< in tolerances (WRMS)
  double seconds = 0.0;  ///< wall time in the projection; measured on every 16th and scaled up

  /// All of them but capped moves and corrector failures.
  long failures() const {
    return not_converged + move_too_long + inconsistent + not_finite + callback_recoverable +
           callback_fatal;
  }
  /// A verdict of one line, then two columns: each quantity that is not zero.
  std::string table() const;
  static std::string names();  ///< of all quantities, separated by commas
  /// The quantity of this name; NaN if there is none.
  double number(const std::string& name) const;
};

/// Writes table().
std::ostream& operator<<(std::ostream& out, const Statistics& statistics);

}  // namespace tether::ida_projection
TETHER_EXPORT_END
