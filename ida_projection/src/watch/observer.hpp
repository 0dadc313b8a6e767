// Tether: what is noticed beside the step: statistics, doubts and their causes.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <limits>
#include <string>
#include <utility>

#include "host/ida_lifetime.hpp"
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
  void reset_statistics();
  Statistics statistics() const;

  /// Keeps the first y of the run, of contiguous vectors.
  void begin_run(const Candidate& candidate) { keep_point_before(candidate, run_.start); }
  /// Names errors of the id vector, multipliers that F does not determine at the start, and too
  /// high an index. The index is known.
  void check_form(const Candidate& candidate);
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
  void skipped(const Move& measured);
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
  std::string explained(Status outcome, const std::string& text) const;
  std::string suspicion(const Attempt& attempt, const Candidate& candidate, Status outcome);
  void corrector_failed(const Candidate& candidate, int flag);

  /// Notices another nonlinear solver in the plugin's place, by IDA's count of steps. `seen`:
  /// accepted before the last attempt; `initialized`: IDA has initialised the plugin. True: IDA
  /// took steps without it, and the text says so once.
  bool bypassed(long seen, bool initialized);
  const std::string& bypass_text() const { return bypass_.text; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr long kWindow = 200;  // accepted steps, in which most attempts fail
  static constexpr long kMostMovedByFalseRow = 5 * kWindow;  // steps, before such a run ends
  static constexpr double kPartInTest = 0.5;  // tolerances: shorter moves fail no error test

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

  void keep_point_before(const Candidate& candidate, OwnedVector& y) const;
  void count_rejections(const Attempt& attempt) {
    const bool moved = run_.moved > kPartInTest;
    if (attempt.repeated) {
      if (moved && std::exchange(run_.last_refused, attempt.steps) != attempt.steps)
        ++run_.refused_steps;
      return;
    }
    run_.moved_in_row = moved ? run_.moved_in_row + 1 : 0;
    run_.standing = attempt.t + attempt.h != attempt.t ? 0 : run_.standing + 1;
    if (attempt.steps >= run_.window_begin + kWindow) end_window(attempt.steps);
  }
  void end_window(long steps);
  void tell_progress(const Attempt& attempt);
  bool goes_on(const Attempt& attempt, const Candidate& candidate);
  void measure(const Candidate& candidate, const Move& move, RowsAt& rows);
  void check_rows(const Attempt& attempt, const Candidate& candidate, N_Vector corrected,
                  RowsAt& rows);
  std::string cause(const Attempt& attempt, const Candidate& candidate);
  std::string wrong_entry(const Candidate& candidate);
  std::string undetermined_multipliers(const Candidate& candidate, N_Vector y);
  std::string too_high_index() const;
  std::string trouble_of_multipliers() const;
  void check_start(const Attempt& attempt, const Move& move);

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
