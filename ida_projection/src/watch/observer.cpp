// Tether: what is noticed beside the step. SPDX-License-Identifier: BSD-3-Clause
#include "watch/observer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "host/mechanisms.hpp"
#include "host/shortest.hpp"
#include "start/linear_system.hpp"
#include "start/nearby_residuals.hpp"

namespace tether::ida_projection {

void Observer::reset_statistics() {
  statistics_ = Statistics{};
  tally_ = Tally();
}

Statistics Observer::statistics() const {
  Statistics s = statistics_;
  s.steps_without_plugin = bypass_.unseen;
  const long moved = s.projections - s.failures();
  s.mean_move = moved > 0 ? tally_.move_sum / static_cast<double>(moved) : 0.0;
  return s;
}

// Extrapolates y back over this step: exact for the first step, up to the curvature for later ones.
void Observer::keep_point_before(const Candidate& candidate, OwnedVector& y) const {
  if (candidate.base_entries == nullptr) return;
  if (!y) y = OwnedVector(candidate.base);
  N_VLinearSum(1.0, candidate.base, -ida_.step_size(), ida_.step().yp_predicted, y);
}

void Observer::check_form(const Candidate& candidate) {
  const std::string doubts =
      options_.id != nullptr ? variables_.doubts(candidate, corrector_) : std::string();
  if (!doubts.empty()) report_.warn(Status::doubtful, doubts);
  if (!variables_.high_index()) return;
  const std::string found =
      run_.start ? undetermined_multipliers(candidate, run_.start) : std::string();
  if (!found.empty() && doubts.empty()) {
    run_.undetermined = "the motion from the start is not determined: there " + found;
    report_.warn(Status::doubtful, run_.undetermined);
  }
  const std::string index = too_high_index();
  if (!index.empty()) report_.warn(Status::doubtful, index);
}

// Names algebraic variables that F does not determine at y (contiguous), because its derivatives
// by them are dependent. Newton's matrix is then singular in every form of F: at singular
// positions, and where joints are given twice. Names the rows of which the same is true, too.
// Empty: there are none, or it is not known (method, section 13).
std::string Observer::undetermined_multipliers(const Candidate& candidate, N_Vector y) {
  if (candidate.base_entries == nullptr || !variables_.any()) return {};
  const double* const entries = N_VGetArrayPointer(y);
  const std::vector<double> at(entries, entries + N_VGetLength(y));
  std::vector<double> change(at.size()), WT(at.size(), 1.0);
  std::vector<int> algebraic;
  for (std::size_t j = 0; j < at.size(); ++j) {
    const double w = candidate.weight_entries[j];
    if (w > 0.0) WT[j] = 1.0 / w;
    change[j] = std::max(w > 0.0 ? WT[j] : 0.0, kWideIncrement * std::max(1.0, std::abs(at[j])));
    if (variables_.mask()[j] == 0.0) algebraic.push_back(static_cast<int>(j));
  }
  if (algebraic.size() > static_cast<std::size_t>(kLargestSize)) return {};
  NearbyResiduals near(candidate, corrector_, statistics_, std::move(change), y);
  Eigen::MatrixXd slopes(at.size(), algebraic.size());
  for (std::size_t k = 0; k < algebraic.size(); ++k)
    if (!near.slope(algebraic[k], NearbyResiduals::Of::values,
                    slopes.col(static_cast<Eigen::Index>(k))))
      return {};
  const std::vector<char> found = undetermined_columns(std::move(slopes), false);
  std::vector<int> free;
  for (std::size_t k = 0; k < found.size(); ++k)
    if (found[k]) free.push_back(algebraic[k]);
  if (free.empty()) return {};
  const std::vector<std::string> rows = faults_.dependent(candidate.t, at, WT);
  return "F does not determine the algebraic variables " + listed(free) +
         ": its derivatives by them depend on each other" +
         (rows.empty() ? "" : ", as do the rows " + listed(rows)) +
         "; start beside a singular position of a mechanism, and leave out joints that are given "
         "twice";
}

// Names multipliers of too high an index, else returns an empty text. Close to a singular position
// the multipliers are the cause that a user can find.
std::string Observer::too_high_index() const {
  if (variables_.index() <= 2 || !run_.undetermined.empty()) return {};
  return "F is of index " + std::to_string(variables_.index()) +
         ", and IDA integrates forms of index 2 at most: put the derivatives of equations without "
         "y' in their place, and give these equations as rows";
}

std::string Observer::trouble_of_multipliers() const {
  if (!variables_.high_index()) return {};
  if (!run_.undetermined.empty()) return "; " + run_.undetermined;
  const std::string index = too_high_index();
  return "; " +
         (index.empty()
              ? "in forms of index 2 or more multipliers carry rounding divided by the step, "
                "which may not allow this tolerance: try a larger one, or a form of index 1 "
                "or 0"
              : index);
}

std::string Observer::explained(Status outcome, const std::string& text) const {
  if (outcome == Status::callback_fatal && corrector_.stopped()) return corrector_.stop_text();
  const std::string index = too_high_index();
  return index.empty() ? text : text + "; " + index;
}

void Observer::corrector_failed(const Candidate& candidate, int flag) {
  ++statistics_.corrector_failures;
  report_.status = Status::corrector_failed;
  const std::string cause = trouble_of_multipliers();
  if (!cause.empty()) report_.message = "IDA's corrector failed" + cause;
  if (flag <= 0 || candidate.base_entries == nullptr ||
      corrector_.failures_in_row() != Report::kSayAfter)
    return;
  report_.advise(variables_.derive(candidate, corrector_));
  OwnedVector y;
  keep_point_before(candidate, y);
  const std::string found = undetermined_multipliers(candidate, y);
  if (!found.empty())
    run_.undetermined = report_.message = "before t = " + std::to_string(candidate.t) + " " + found;
}

void Observer::end_window(long steps) {
  if (3 * run_.refused_steps > kWindow) run_.refused = true;
  run_.window_begin = steps;
  run_.refused_steps = 0;
}

void Observer::tell_progress(const Attempt& attempt) {
  if (!attempt.accepted || !std::isfinite(run_.moved)) return;
  run_.progress.steps = attempt.steps;
  std::string ignored;
  guarded([&] { return options_.progress(run_.progress), 0; }, ignored);
}

// False: the run is hopeless.
bool Observer::goes_on(const Attempt& attempt, const Candidate& candidate) {
  if (run_.standing >= kWindow) {
    report_.warn(Status::collapsed, "t stands at " + brief(attempt.t) +
                                        ": steps are shorter than its rounding" +
                                        trouble_of_multipliers());
    return false;
  }
  const bool false_row = faults_.false_row_found();
  const bool collapsed = run_.refused || (false_row && run_.moved_in_row >= kMostMovedByFalseRow);
  if (!collapsed || report_.warning() == Status::collapsed) return true;
  report_.warn(Status::collapsed, cause(attempt, candidate));
  return !false_row;
}

// Why most steps are rejected, found at the corrector's point.
std::string Observer::cause(const Attempt& attempt, const Candidate& candidate) {
  const std::string found = wrong_entry(candidate);
  return (run_.refused ? "IDA rejected attempts at many of the last " + std::to_string(kWindow)
                       : "each of the last " + std::to_string(run_.moved_in_row)) +
         " steps before t = " + brief(attempt.t) +
         (run_.refused ? "" : " was moved by about what the error test allows") +
         (found.empty() && report_.warning() != Status::doubtful
              ? "; check the rows with check_jacobian, the id vector and the tolerances"
              : found);
}

// "; check_jacobian finds there: ...". Any row bends over tolerances that exceed most unknowns.
std::string Observer::wrong_entry(const Candidate& candidate) {
  if (candidate.base_entries == nullptr) return {};
  std::vector<double> y(static_cast<std::size_t>(N_VGetLength(candidate.base)));
  std::size_t below = 0;
  for (std::size_t j = 0; j < y.size(); ++j) {
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
    below += std::abs(y[j]) * candidate.weight_entries[j] < 1.0 ? 1U : 0U;
  }
  const std::string entry = faults_.wrong_entry(candidate.t, y);
  if (!entry.empty()) return "; check_jacobian finds there: " + entry;
  if (2 * below <= y.size()) return {};
  return "; " + std::to_string(below) + " of " + std::to_string(y.size()) +
         " unknowns are smaller than their tolerances: reduce atol";
}

// If moves do not converge C is wrong, as a rule; the candidate is where they have led, and y' need
// not fulfil F there. Looked for once in a step, and only if it is printed.
std::string Observer::suspicion(const Attempt& attempt, const Candidate& candidate,
                                Status outcome) {
  if (outcome != Status::not_converged || !report_.prints_failures(attempt.steps)) return {};
  if (std::exchange(run_.suspected, attempt.steps) != attempt.steps)
    run_.suspicion = wrong_entry(candidate);
  return run_.suspicion;
}

void Observer::skipped(const Move& measured) {
  ++statistics_.skipped;
  for (double* largest : {&statistics_.largest_drift_before, &statistics_.largest_drift_after})
    *largest = std::max(*largest, measured.drift_before);
}

void Observer::measure(const Candidate& candidate, const Move& move, RowsAt& rows) {
  const double left = rows.remaining_drift(candidate);
  if (move.status == Status::success)
    statistics_.largest_drift_after = std::max(statistics_.largest_drift_after, left);
  statistics_.seconds += std::chrono::duration<double>(Clock::now() - move_begun_).count() *
                         static_cast<double>(tally_.attempts == 1 ? 1 : kOneIn);
}

void Observer::check_rows(const Attempt& attempt, const Candidate& candidate, N_Vector corrected,
                          RowsAt& rows) {
  if (report_.warning() != Status::success || !in_use(Mechanism::false_row_watch)) return;
  const std::string doubt =
      faults_.check(candidate, attempt, corrected, variables_, rows, corrector_);
  if (!doubt.empty()) report_.warn(Status::doubtful, doubt);
  if (report_.advice.empty()) report_.advice = faults_.idle_row();
}

// From a start off the constraints moves do not shrink with the step. Above Advanced::largest_move
// they are refused by name, below IDA's error test refuses them, with words of its own.
void Observer::check_start(const Attempt& attempt, const Move& move) {
  const double before = std::exchange(run_.first_move, move.length);
  const bool stays = attempt.repeated && move.length > 1.0 && move.length > 0.5 * before;
  run_.refused_starts = stays ? run_.refused_starts + 1 : 0;
  if (run_.refused_starts == Report::kSayAfter)
    report_.warn(Status::doubtful,
                 "IDA's error test refuses the first step, however short it is: the start is " +
                     brief(move.length) +
                     " tolerances off the constraints; call make_consistent first");
}

// After an attempt IDA has accepted at most one step that the plugin has not heard of: IDA's count
// has to be the one at the last attempt, or one more, or less after IDAReInit.
bool Observer::bypassed(long seen, bool initialized) {
  long steps = 0;
  if (bypass_.at_attach >= 0 && lifetime_.alive() && IDAGetNumSteps(ida_.mem(), &steps) == 0) {
    const long least = initialized ? seen : bypass_.at_attach;
    const long most = initialized ? seen + 1 : bypass_.at_attach;
    if (steps > most) bypass_.unseen = steps - most;
    if (steps < least && steps > 0) bypass_.unseen = steps;
  }
  if (bypass_.unseen > 0 && bypass_.text.empty()) {
    bypass_.text =
        "IDA took " + std::to_string(bypass_.unseen) +
        " steps without the plugin, which projected none of them: another nonlinear solver was "
        "attached after it; make the Projection last, or hand that solver over in "
        "Options::nonlinear_solver";
    report_.print(bypass_.text);
  }
  return bypass_.unseen > 0;
}

}  // namespace tether::ida_projection
