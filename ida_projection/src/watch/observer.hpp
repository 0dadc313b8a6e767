// Tether: what is noticed beside the step: statistics, doubts and their causes.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "host/ida_lifetime.hpp"
#include "host/mechanisms.hpp"
#include "host/shortest.hpp"
#include "start/linear_system.hpp"
#include "start/nearby_residuals.hpp"
#include "step/attempt.hpp"
#include "watch/report.hpp"
#include "watch/row_faults.hpp"

namespace tether::ida_projection {

/// Counts, measures and explains. It never steers a step, but ends a run that stands still, or in
/// which a false row takes every step about as far as IDA's error test allows.
class Observer {
 public:
  Observer(const Constraints& constraints, const Options& options, Statistics& statistics,
           Report& report, const Ida& ida, const IdaLifetime& lifetime, Corrector& corrector,
           AlgebraicVariables& variables)
      : options_(options),
        statistics_(statistics),
        report_(report),
        ida_(ida),
        lifetime_(lifetime),
        corrector_(corrector),
        variables_(variables),
        faults_(constraints, statistics) {}

  void attached() { bypass_.at_attach = ida_.steps(); }
  void reset() { run_ = Run(), faults_.reset(); }  ///< a new run starts
  void reset_statistics() {
    statistics_ = Statistics{};
    tally_ = Tally();
  }
  Statistics statistics() const {
    Statistics s = statistics_;
    s.steps_without_plugin = bypass_.unseen;
    const long moved = s.projections - s.failures();
    s.mean_move = moved > 0 ? tally_.move_sum / static_cast<double>(moved) : 0.0;
    return s;
  }

  /// Keeps the first y of the run, of contiguous vectors.
  void begin_run(const Candidate& candidate) { keep_point_before(candidate, run_.start); }
  /// Names errors of the id vector, multipliers that F does not determine at the start, and too
  /// high an index. The index is known.
  void check_form(const Candidate& candidate) {
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
  /// Before the move of an attempt. False: the run is hopeless, the report's warning says why.
  bool begin_attempt(const Attempt& attempt, const Candidate& candidate) {
    count_rejections(attempt);
    if (options_.progress) tell_progress(attempt);
    run_.moved = std::numeric_limits<double>::infinity();
    const bool doubtful =
        run_.standing >= kWindow || run_.refused || run_.moved_in_row >= kMostMovedByFalseRow;
    return !doubtful || goes_on(attempt, candidate);
  }
  /// An attempt that needed no move.
  void skipped(const Move& measured) {
    ++statistics_.skipped;
    for (double* largest : {&statistics_.largest_drift_before, &statistics_.largest_drift_after})
      *largest = std::max(*largest, measured.drift_before);
  }
  /// Before and after a move. Reading the clock costs as much as a small projection: the first one
  /// is timed, which finds out what the others keep, and every 16th for the others. These see what
  /// g is left, too.
  void begin_move() {
    if (tally_.attempts++ % kOneIn == 0) move_begun_ = Clock::now();
  }
  void after_move(const Attempt& attempt, const Candidate& candidate, const Move& move,
                  N_Vector corrected, RowsAt& rows) {
    if ((tally_.attempts - 1) % kOneIn == 0) measure(candidate, move, rows);
    ++(move.not_needed ? statistics_.skipped : statistics_.projections);
    if (move.capped) ++statistics_.moves_capped;
    if (move.status != Status::success) return;
    statistics_.largest_drift_before =
        std::max(statistics_.largest_drift_before, move.drift_before);
    statistics_.largest_move = std::max(statistics_.largest_move, move.length);
    tally_.move_sum += move.length;
    run_.moved = move.length;
    if (options_.progress)
      run_.progress = {attempt.t, attempt.h, attempt.order, move.drift_before, move.length, 0};
    if (attempt.steps == 0) check_start(attempt, move);
    if (!attempt.repeated && RowFaults::are_checked(attempt.steps))
      check_rows(attempt, candidate, corrected, rows);
  }

  /// The message of a failed attempt, with causes where they are to be printed.
  std::string explained(Status outcome, const std::string& text) const {
    if (outcome == Status::callback_fatal && corrector_.stopped()) return corrector_.stop_text();
    const std::string index = too_high_index();
    return index.empty() ? text : text + "; " + index;
  }
  /// If moves do not converge C is wrong, as a rule. Looked for at the candidate, where they have
  /// led, once in a step, and only if it is printed.
  std::string suspicion(const Attempt& attempt, const Candidate& candidate, Status outcome) {
    if (outcome != Status::not_converged || !report_.prints_failures(attempt.steps)) return {};
    if (std::exchange(run_.suspected, attempt.steps) != attempt.steps)
      run_.suspicion = wrong_entry(candidate);
    return run_.suspicion;
  }
  void corrector_failed(const Candidate& candidate, int flag) {
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
      run_.undetermined = report_.message =
          "before t = " + std::to_string(candidate.t) + " " + found;
  }

  /// Notices another nonlinear solver in the plugin's place, by IDA's count of steps. `seen`:
  /// accepted before the last attempt; `initialized`: IDA has initialised the plugin. True: IDA
  /// took steps without it, and the text says so once. After an attempt IDA has accepted at most
  /// one step that the plugin has not heard of; after IDAReInit its count is less.
  bool bypassed(long seen, bool initialized) {
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
  const std::string& bypass_text() const { return bypass_.text; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr long kWindow = 200;  // accepted steps, in which most attempts fail
  static constexpr long kMostMovedByFalseRow = 5 * kWindow;  // steps, before such a run ends

  struct Run {
    OwnedVector start;         // its first y, of contiguous vectors
    std::string undetermined;  // multipliers at the start, or where correctors fail
    double first_move = 0.0;   // of the last attempt at the first step, in tolerances
    int refused_starts = 0;    // attempts at it with a move that does not shrink
    double moved = std::numeric_limits<double>::infinity();  // in the last attempt; inf: it failed
    Progress progress;                          // what the caller is told once it is accepted
    long moved_in_row = 0, standing = 0;        // accepted steps
    long window_begin = 0;                      // accepted steps when they were last counted
    long refused_steps = 0, last_refused = -1;  // of these, steps with a rejection
    bool refused = false;                       // most steps of a stretch
    long suspected = -1;                        // the step that was diagnosed
    std::string suspicion;                      // found then
  };
  struct Tally {
    double move_sum = 0.0;
    long attempts = 0;  // since moves began
  };
  struct Bypass {
    long at_attach = -1, unseen = 0;
    std::string text;
  };

  // Extrapolates y back over this step: exact for the first step, up to the curvature for later
  // ones.
  void keep_point_before(const Candidate& candidate, OwnedVector& y) const {
    if (candidate.base_entries == nullptr) return;
    if (!y) y = OwnedVector(candidate.base);
    N_VLinearSum(1.0, candidate.base, -ida_.step_size(), ida_.step().yp_predicted, y);
  }
  void count_rejections(const Attempt& attempt) {
    const bool moved = run_.moved > 0.5;  // tolerances: shorter moves fail no error test
    if (attempt.repeated) {
      if (moved && std::exchange(run_.last_refused, attempt.steps) != attempt.steps)
        ++run_.refused_steps;
      return;
    }
    run_.moved_in_row = moved ? run_.moved_in_row + 1 : 0;
    run_.standing = attempt.t + attempt.h != attempt.t ? 0 : run_.standing + 1;
    if (attempt.steps < run_.window_begin + kWindow) return;
    run_.refused = run_.refused || 3 * run_.refused_steps > kWindow;
    run_.window_begin = attempt.steps;
    run_.refused_steps = 0;
  }
  void tell_progress(const Attempt& attempt) {
    if (!attempt.accepted || !std::isfinite(run_.moved)) return;
    run_.progress.steps = attempt.steps;
    std::string ignored;
    guarded([&] { return options_.progress(run_.progress), 0; }, ignored);
  }
  // False: the run is hopeless.
  bool goes_on(const Attempt& attempt, const Candidate& candidate) {
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
  [[gnu::noinline]] void measure(const Candidate& candidate, const Move& move, RowsAt& rows) {
    const double left = rows.remaining_drift(candidate);
    if (move.status == Status::success)
      statistics_.largest_drift_after = std::max(statistics_.largest_drift_after, left);
    statistics_.seconds += std::chrono::duration<double>(Clock::now() - move_begun_).count() *
                           static_cast<double>(tally_.attempts == 1 ? 1 : kOneIn);
  }
  [[gnu::noinline]] void check_rows(const Attempt& attempt, const Candidate& candidate,
                                    N_Vector corrected, RowsAt& rows) {
    if (report_.warning() != Status::success || !in_use(Mechanism::false_row_watch)) return;
    const std::string doubt =
        faults_.check(candidate, attempt, corrected, variables_, rows, corrector_);
    if (!doubt.empty()) report_.warn(Status::doubtful, doubt);
    if (report_.advice.empty()) report_.advice = faults_.idle_row();
  }
  // Why most steps are rejected, found at the corrector's point.
  std::string cause(const Attempt& attempt, const Candidate& candidate) {
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
  std::string wrong_entry(const Candidate& candidate) {
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
  // Names algebraic variables that F does not determine at y (contiguous), because its derivatives
  // by them are dependent. Newton's matrix is then singular in every form of F: at singular
  // positions, and where joints are given twice. Names the rows of which the same is true, too.
  // Empty: there are none, or it is not known (method, section 13).
  std::string undetermined_multipliers(const Candidate& candidate, N_Vector y) {
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
  // Names multipliers of too high an index, else returns an empty text. Close to a singular
  // position the multipliers are the cause that a user can find.
  std::string too_high_index() const {
    if (variables_.index() <= 2 || !run_.undetermined.empty()) return {};
    return "F is of index " + std::to_string(variables_.index()) +
           ", and IDA integrates forms of index 2 at most: put the derivatives of equations "
           "without y' in their place, and give these equations as rows";
  }
  std::string trouble_of_multipliers() const {
    if (!variables_.high_index()) return {};
    if (!run_.undetermined.empty()) return "; " + run_.undetermined;
    const std::string index = too_high_index();
    if (!index.empty()) return "; " + index;
    return "; in forms of index 2 or more multipliers carry rounding divided by the step, which "
           "may not allow this tolerance: try a larger one, or a form of index 1 or 0";
  }
  // From a start off the constraints moves do not shrink with the step. Above
  // Advanced::largest_move they are refused by name, below IDA's error test refuses them, with
  // words of its own.
  void check_start(const Attempt& attempt, const Move& move) {
    const double before = std::exchange(run_.first_move, move.length);
    const bool stays = attempt.repeated && move.length > 1.0 && move.length > 0.5 * before;
    run_.refused_starts = stays ? run_.refused_starts + 1 : 0;
    if (run_.refused_starts == Report::kSayAfter)
      report_.warn(Status::doubtful,
                   "IDA's error test refuses the first step, however short it is: the start is " +
                       brief(move.length) +
                       " tolerances off the constraints; call make_consistent first");
  }

  const Options& options_;
  Statistics& statistics_;
  Report& report_;
  const Ida& ida_;
  const IdaLifetime& lifetime_;
  Corrector& corrector_;
  AlgebraicVariables& variables_;
  RowFaults faults_;
  Run run_;
  Tally tally_;
  Bypass bypass_;
  Clock::time_point move_begun_;
};

}  // namespace tether::ida_projection
