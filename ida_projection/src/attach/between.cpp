// Tether: steps between full projections, Options::frequency. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "attach/impl.hpp"

namespace tether::ida_projection {

// False: this attempt is done, left alone or moved with the factors at hand.
bool Projection::Impl::needs_projection(const Candidate& candidate, const StepData& step,
                                        double tolerance) {
  const FrequencyPolicy::Need need = frequency_.need(attempts_.steps, attempts_.repeated,
                                                     std::abs(ida_.step_size()), run_.engaged);
  if (need == FrequencyPolicy::Need::projection) return true;
  if (need == FrequencyPolicy::Need::nothing) {
    if (run_.engaged && !leave_alone(candidate, step, tolerance)) return true;
    frequency_.left_alone();
    ++statistics_.left_alone;
    return false;
  }
  // Where stiff components have answered to moves, none may go astray.
  return !(run_.engaged && !metric_choice_.by_levels() && movers_.used->may_follow() &&
           follow(candidate, step, tolerance));
}

// Only the iteration that removes noise. False: old factors misled the corrector, which a projected
// step looks into.
bool Projection::Impl::leave_alone(const Candidate& candidate, const StepData& step,
                                   double tolerance) {
  if (!wants_polish(0.0)) return true;
  polish_.keep(candidate);
  if (!polish_.add_newton_step(candidate, step.cj, tolerance) || polish_.corrector_was_right())
    return true;
  polish_.restore(candidate);
  return false;
}

// One g and one solve, and the same again after the iteration at the moved point. Without that
// iteration, or with one before the move, stiff components do not answer to the move and oscillate.
bool Projection::Impl::follow(const Candidate& candidate, const StepData& step, double tolerance) {
  polish_.keep(candidate);
  const Move move = movers_.used->follow(candidate, false);
  bool done = move.status == Status::success;
  if (done && wants_polish(move.length) && polish_.add_newton_step(candidate, step.cj, tolerance))
    done = polish_.corrector_was_right() &&
           movers_.used->follow(candidate, true).status == Status::success;
  if (!done) {
    polish_.restore(candidate);
    return false;
  }
  ++statistics_.chord_projections;
  frequency_.looked(move.length, std::abs(ida_.step_size()));
  note(move, step);
  return true;
}

}  // namespace tether::ida_projection
