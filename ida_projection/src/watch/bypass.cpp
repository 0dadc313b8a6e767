// Tether: another nonlinear solver in the plugin's place is noticed. SPDX-License-Identifier:
// BSD-3-Clause
#include <cstdio>

#include "attach/impl.hpp"

namespace tether::ida_projection {

// After an attempt IDA has accepted at most one step that the plugin has not heard of: IDA's count
// has to be the one at the last attempt, or one more, or none after IDAReInit.
long Projection::Impl::steps_without_plugin() const {
  if (!mover_ || !lifetime_.alive()) return steps_unseen_;
  long steps = 0;
  if (IDAGetNumSteps(ida_mem_, &steps) != 0 || steps == 0) return steps_unseen_;
  const long expected = initialized_ ? last_steps_ + 1 : steps_at_attach_;
  if (steps > expected) return steps - expected;
  const bool begun_anew = steps < (initialized_ ? last_steps_ : steps_at_attach_);
  return begun_anew ? steps : steps_unseen_;
}

// Status and text once it happened; said once.
void Projection::Impl::look_for_bypass() {
  steps_unseen_ = steps_without_plugin();
  if (steps_unseen_ == 0) return;
  status = Status::never_called;
  message = "IDA took " + std::to_string(steps_unseen_) +
            " steps without the plugin, which projected none of them: another nonlinear solver was "
            "attached after it; make the Projection last, or hand that solver over in "
            "Options::nonlinear_solver";
  if (!said_bypass_) say_once(message);
  said_bypass_ = true;
}

}  // namespace tether::ida_projection
