// Tether: another nonlinear solver in the plugin's place is noticed.
// SPDX-License-Identifier: BSD-3-Clause
#include "watch/bypass.hpp"

namespace tether::ida_projection {

void BypassWatch::begin() {
  watching_ = true;
  steps_at_attach_ = ida_.steps();
}

// Between two calls of the plugin IDA accepts at most one step: its count has to be that of the
// last attempt, or one more, or 0 after IDAReInit.
long BypassWatch::steps_without_plugin(long last_steps, bool initialized) const {
  if (!watching_ || !lifetime_.alive()) return steps_unseen_;
  long steps = 0;
  if (IDAGetNumSteps(ida_.mem(), &steps) != 0 || steps == 0) return steps_unseen_;
  const long expected = initialized ? last_steps + 1 : steps_at_attach_;
  if (steps > expected) return steps - expected;
  const bool begun_anew = steps < (initialized ? last_steps : steps_at_attach_);
  return begun_anew ? steps : steps_unseen_;
}

void BypassWatch::check(long last_steps, bool initialized, const Report& report) {
  steps_unseen_ = steps_without_plugin(last_steps, initialized);
  if (steps_unseen_ == 0 || !text_.empty()) return;
  text_ = "IDA took " + std::to_string(steps_unseen_) +
          " steps without the plugin, which projected none of them: another nonlinear solver was "
          "attached after it; make the Projection last, or hand that solver over in "
          "Options::nonlinear_solver";
  report.say(text_);
}

}  // namespace tether::ida_projection
