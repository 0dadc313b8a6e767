// Tether: search for the reason why IDA rejects most steps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "host/ida.hpp"
#include "start/algebraic.hpp"
#include "watch/row_faults.hpp"

namespace tether::ida_projection {

/// Counts the attempts that IDA rejects. If they are the majority in a window of steps, it finds
/// the cause.
class RejectionWatch {
 public:
  explicit RejectionWatch(RowFaults* faults) : faults_(faults) {}

  void reset() { *this = RejectionWatch(faults_); }  ///< a new run starts
  /// Called at each new attempt. `repeated`: the last one was rejected; `moved`: its move was long
  /// enough to fail the error test; `advances`: t changes with this one; `steps`: accepted before
  /// it.
  void count(bool moved, bool repeated, bool advances, long steps);
  /// Whether many accepted steps were shorter than the rounding of t.
  bool stands() const { return standing_ >= kWindow; }
  /// Whether most steps of a window were rejected, or long moves were made in every step of a
  /// longer window and a row is known to be false.
  bool collapsed(bool false_row) const {
    return refused_ || (false_row && moved_in_row_ >= 5 * kWindow);
  }
  /// The cause, found at the corrector's point, where y' = yppred + cj ycor satisfies F. `doubt`: a
  /// cause that was found before.
  std::string cause(const Candidate& candidate, const StepData& step,
                    const AlgebraicVariables& variables, Corrector& corrector,
                    const std::string& doubt);
  /// A reason why moves do not shrink at this point, with "; " before it, looked for once in the
  /// step after `steps`; empty: nothing found.
  const std::string& suspicion(const Candidate& candidate, Corrector& corrector, long steps);

 private:
  static constexpr long kWindow = 200;  // accepted steps

  RowFaults* faults_;
  long moved_in_row_ = 0, standing_ = 0;         // accepted steps
  long rejections_ = 0, rejections_before_ = 0;  // attempts that IDA repeated
  long window_begin_ = 0;                        // accepted steps when they were last counted
  long refused_steps_ = 0, last_refused_ = -1;   // of these, steps with a rejection
  bool refused_ = false;                         // most steps of a stretch
  long suspected_ = -1;                          // the step that was diagnosed
  std::string suspicion_;                        // found then
};

}  // namespace tether::ida_projection
