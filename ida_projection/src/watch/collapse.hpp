// Tether: search for the reason why IDA rejects most steps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "host/corrector.hpp"
#include "host/ida.hpp"
#include "movers/mover.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// Counts the attempts that IDA rejects. If they are the majority in a window of steps, it finds
/// the cause.
class RejectionWatch {
 public:
  explicit RejectionWatch(const Constraints& constraints) : constraints_(constraints) {}

  void reset();  ///< a new run starts
  /// Called at each new attempt. `repeated`: the last one was rejected; `moved`: its move was long
  /// enough to fail the error test; `advances`: t changes with this one; `steps`: accepted before
  /// it.
  void count(bool moved, bool repeated, bool advances, long steps);
  /// Whether many accepted steps were shorter than the rounding of t.
  bool stands() const { return standing_ >= kMostStanding; }
  /// Whether most steps of a window were rejected, or long moves were made in every step of a
  /// longer window and a row is known to be false.
  bool collapsed(bool false_row) const {
    return collapsed_ || (false_row && moved_in_row_ >= kMostMoved);
  }
  /// The cause, found at the corrector's point, where y' = yppred + cj ycor satisfies F. `doubt`: a
  /// cause that was found before.
  std::string cause(const Candidate& candidate, const StepData& step,
                    const AlgebraicVariables& variables, Corrector& corrector,
                    const std::string& doubt) const;
  /// A reason why moves do not shrink at this point, with "; " before it; empty: nothing found.
  std::string suspicion(const Candidate& candidate, Corrector& corrector) const;

 private:
  std::string wrong_entry(const Candidate& candidate) const;
  std::string suspected_row(const Candidate& candidate, const StepData& step) const;
  std::string squared_row(const Candidate& candidate, Corrector& corrector) const;

  static constexpr long kMostMoved = 1000;  // accepted steps; order and h have settled by then

  static constexpr long kMostStanding = 200;  // accepted steps: IDA would go on for ever

  const Constraints& constraints_;
  long moved_in_row_ = 0, standing_ = 0;         // accepted steps
  long rejections_ = 0, rejections_before_ = 0;  // attempts that IDA repeated
  long window_begin_ = 0;                        // accepted steps when they were last looked at
  long refused_steps_ = 0;                       // of these, steps with a rejection
  bool rejected_in_step_ = false, collapsed_ = false;
};

}  // namespace tether::ida_projection
