// Tether: what steers IDA's step sizes and orders, at the end of a successful solve.
// SPDX-License-Identifier: BSD-3-Clause
#include "attach/impl.hpp"

namespace tether::ida_projection {

// IDA computes its weights anew for a new step, but not for another attempt at the same one.
void Projection::Impl::restore_weights(N_Vector weights) {
  if (weights_factor_ == 1.0) return;
  long steps = 0;
  IDAGetNumSteps(ida_mem_, &steps);
  if (steps == last_steps_) N_VScale(1.0 / weights_factor_, weights, weights);
  weights_factor_ = 1.0;
}

// In the norm of IDA's error test.
double Projection::Impl::error_norm(N_Vector v, N_Vector weights) const {
  const bool suppressed = engaged_ && id_ && has_algebraic_ && options_.suppress_algebraic;
  return suppressed ? N_VWrmsNormMask(v, weights, id_) : N_VWrmsNorm(v, weights);
}

// |ycor| decides the next step size, and what it is beside the second difference the order.
void Projection::Impl::control_step(const Candidate& candidate) {
  if (!engaged_ && !smoother_.on()) return;
  long steps = 0;
  IDAGetNumSteps(ida_mem_, &steps);
  if (smoother_.on()) {
    order_limit_.end();
    weights_factor_ = smoother_.control(steps, error_norm(candidate.correction, candidate.weights));
  } else {
    compare_slopes(candidate, steps);
    const double norm =
        order_limit_.lowering() ? error_norm(candidate.correction, candidate.weights) : 0.0;
    weights_factor_ = order_limit_.control(steps, step_data().t, norm);
    statistics_.order_limited = order_limit_.begun();
  }
  if (weights_factor_ != 1.0) N_VScale(weights_factor_, candidate.weights, candidate.weights);
}

// y' of two steps in a row, now and then, for the order.
void Projection::Impl::compare_slopes(const Candidate& candidate, long steps) {
  const bool keeps = order_limit_.keeps_slope(steps);
  if (!keeps && !(kept_slope_ && order_limit_.compares_slopes(steps))) return;
  const StepData step = step_data();
  if (!kept_slope_) kept_slope_ = OwnedVector(candidate.base);
  N_Vector slope = keeps ? kept_slope_ : delta_;
  N_VLinearSum(1.0, step.yp_predicted, step.cj, candidate.correction, slope);
  if (keeps) return;
  N_VLinearSum(1.0, slope, -1.0, kept_slope_, slope);
  order_limit_.note_differences(steps, error_norm(candidate.correction, candidate.weights),
                                step_size() * error_norm(slope, candidate.weights));
}

}  // namespace tether::ida_projection
