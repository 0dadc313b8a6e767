// Tether: what the caller is told of failed steps and starts. SPDX-License-Identifier:
// BSD-3-Clause
#include <utility>

#include "attach/impl.hpp"
#include "host/mechanisms.hpp"
#include "host/shortest.hpp"
#include "watch/dead_point.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kNameAfter = 3;      // failed correctors in a row before multipliers are named
constexpr int kRefusedStarts = 5;  // failed error tests of the first step; IDA gives up after ten

}  // namespace

// From a start off the constraints moves do not shrink with the step. Above Advanced::largest_move
// they are refused by name, below IDA's error test refuses them, with words of its own.
void Projection::Impl::check_start(const Move& move) {
  if (attempts_.steps != 0) return;
  const double before = std::exchange(attempts_.first_move, move.length);
  const bool stays = attempts_.repeated && move.length > 1.0 && move.length > 0.5 * before;
  attempts_.refused_starts = stays ? attempts_.refused_starts + 1 : 0;
  if (attempts_.refused_starts != kRefusedStarts) return;
  report_.warn(Status::doubtful,
               "IDA's error test refuses the first step, however short it is: "
               "the start is " +
                   brief(move.length) +
                   " tolerances off the constraints; call make_consistent first");
}

void Projection::Impl::check_rows(const Candidate& candidate, const StepData& step) {
  if (!FirstSteps::are_checked(attempts_.steps) || attempts_.repeated ||
      report_.warning() != Status::success || !in_use(Mechanism::false_row_watch))
    return;
  const std::string doubt =
      watch_.first_steps.check(candidate, step, attempts_.steps, ida_.step_size(),
                               polish_.corrected(), variables_, *movers_.used, corrector_);
  if (!doubt.empty()) report_.warn(Status::doubtful, doubt);
  if (report_.advice.empty()) report_.advice = watch_.first_steps.idle_row();
}

// Extrapolates y back over this step: exact for the first step, up to the curvature for later ones.
void Projection::Impl::keep_point_before(const Candidate& candidate, OwnedVector& y) {
  if (!y) y = OwnedVector(candidate.base);
  N_VLinearSum(1.0, candidate.base, -ida_.step_size(), ida_.step().yp_predicted, y);
}

std::string Projection::Impl::undetermined_at(const Candidate& candidate, N_Vector y) {
  return undetermined_multipliers(candidate, y, variables_, corrector_, watch_.faults, statistics_);
}

// Names multipliers of too high an index, else returns an empty text. Close to a singular position
// the multipliers are the cause that a user can find.
std::string Projection::Impl::too_high_index() const {
  if (variables_.index() <= 2 || !run_.undetermined.empty()) return {};
  return "F is of index " + std::to_string(variables_.index()) +
         ", and IDA integrates forms of index 2 at most: put the derivatives of equations without "
         "y' in their place, and give these equations as rows";
}

std::string Projection::Impl::rounding_of_multipliers() const {
  return variables_.high_index()
             ? "; in forms of index 2 or more multipliers carry rounding divided by the step, "
               "which may not allow this tolerance: try a larger one, or a form of index 1 or 0"
             : "";
}

// Ends a run in which IDA rejects most steps. Returns the code for IDA then.
std::optional<int> Projection::Impl::watch_rejections(const Candidate& candidate,
                                                      const StepData& step) {
  if (watch_.rejections.stands()) {
    report_.warn(Status::collapsed, "t stands at " + brief(step.t) +
                                        ": steps are shorter than its rounding" +
                                        rounding_of_multipliers());
    return report_.end(Status::collapsed);
  }
  const bool false_row = watch_.first_steps.false_row_found();
  if (!watch_.rejections.collapsed(false_row) || report_.warning() == Status::collapsed) return {};
  const std::string doubt = report_.warning() == Status::doubtful ? report_.warning_text() : "";
  const std::string cause = watch_.rejections.cause(candidate, step, variables_, corrector_, doubt);
  report_.warn(Status::collapsed, cause,
               doubt.empty() ? cause : cause.substr(0, cause.rfind("; " + doubt)));
  return false_row ? std::optional<int>(report_.end(Status::collapsed)) : std::nullopt;
}

int Projection::Impl::corrector_failed(const Candidate& candidate, int flag) {
  ++statistics_.corrector_failures;
  report_.status = Status::corrector_failed;
  if (flag > 0) control_.corrector_failed(run_.engaged);
  polish_.corrector_failed();
  if (variables_.high_index())
    report_.message = "IDA's corrector failed" + rounding_of_multipliers();
  if (variables_.high_index() && !run_.undetermined.empty())
    report_.message += "; " + run_.undetermined;
  const std::string index = too_high_index();
  if (!index.empty()) report_.message = "IDA's corrector failed; " + index;
  if (flag > 0 && unknowns_.contiguous && corrector_.failures_in_row() == kNameAfter) {
    Candidate before = candidate;
    before.t = ida_.step().t;
    if (!variables_.known()) derive_id(before);
    OwnedVector y;
    keep_point_before(before, y);
    const std::string found = undetermined_at(before, y);
    if (!found.empty())
      run_.undetermined = report_.message = "before t = " + std::to_string(before.t) + " " + found;
  }
  return flag;
}

}  // namespace tether::ida_projection
