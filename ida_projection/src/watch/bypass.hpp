// Tether: another nonlinear solver in the plugin's place is noticed.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "host/ida.hpp"
#include "host/ida_lifetime.hpp"
#include "watch/report.hpp"

namespace tether::ida_projection {

/// Compares IDA's count of steps with the attempts that the plugin has seen.
class BypassWatch {
 public:
  BypassWatch(const Ida& ida, const IdaLifetime& lifetime) : ida_(ida), lifetime_(lifetime) {}

  void begin() { steps_at_attach_ = ida_.steps(); }  ///< at attachment
  /// `last_steps`: accepted before the last attempt; none seen: -1. Said once.
  void check(long last_steps, bool initialized, const Report& report) {
    long steps = 0;
    if (steps_at_attach_ < 0 || !lifetime_.alive() || IDAGetNumSteps(ida_.mem(), &steps) != 0)
      return;
    // After an attempt IDA has accepted at most one step that the plugin has not heard of: IDA's
    // count has to be the one at the last attempt, or one more, or less after IDAReInit.
    const long least = initialized ? last_steps : steps_at_attach_;
    const long most = initialized ? last_steps + 1 : steps_at_attach_;
    if (steps > most) steps_unseen_ = steps - most;
    if (steps < least && steps > 0) steps_unseen_ = steps;
    if (steps_unseen_ == 0 || !text_.empty()) return;
    text_ = "IDA took " + std::to_string(steps_unseen_) +
            " steps without the plugin, which projected none of them: another nonlinear solver was "
            "attached after it; make the Projection last, or hand that solver over in "
            "Options::nonlinear_solver";
    report.print(text_);
  }
  long steps() const { return steps_unseen_; }
  /// Advice, once a step went by; it then stays as it is.
  const std::string& text() const { return text_; }

 private:
  const Ida& ida_;
  const IdaLifetime& lifetime_;
  long steps_at_attach_ = -1, steps_unseen_ = 0;
  std::string text_;
};

}  // namespace tether::ida_projection
