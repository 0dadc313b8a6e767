// Tether: the decorator of IDA's nonlinear solver. SPDX-License-Identifier: BSD-3-Clause
//
// IDA's nonlinear solver returns the correction ycor. IDA then forms y = ypred + ycor and
// y' = yppred + cj ycor, and bases its error test, order and history on ycor. Moving ycor here,
// after the decorated solver has converged, is the method of Hanson and Krogh (method, section 2):
// the accepted y lies on the constraints, and so do the points that predict the next step.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "attach/impl.hpp"
#include "host/mechanisms.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

using Clock = std::chrono::steady_clock;

constexpr long kSampleEvery = 16;
constexpr double kSudden = 10.0;     // times the last accepted move: longer ones follow a jump of F
constexpr double kPartInTest = 0.5;  // tolerances: shorter moves fail no error test

}  // namespace

// IDA calls this once tolerances, linear solver and sensitivities are known.
int Projection::Impl::initialize() {
  run_.initialized = run_.broken = false;
  // If IDAS solves states and sensitivities together it bypasses this solver, and no getter tells
  // so. IDASetMaxNonlinIters is called to see whether it arrives here. Without constraints
  // nothing would be lost.
  if (movers_.used != nullptr && !corrector_.is_reached_by(ida_)) {
    finish(Status::simultaneous_sensitivities,
           "IDAS with IDA_SIMULTANEOUS does not use the state's nonlinear solver, so nothing would "
           "be projected; use IDA_STAGGERED in IDASensInit");
    return kFatal;
  }
  run_.initialized = true;
  run_.engaged = false;
  test_all_again();
  run_.start = OwnedVector();
  run_.undetermined.clear();
  run_.iterative.reset();
  options_.advanced.metric = wanted_metric_;
  attempts_ = Attempts();
  report_.reset();
  watch_.rejections.reset();
  watch_.first_steps.reset();
  variables_.begin_run();
  movers_.joined.forget();
  movers_.used = movers_.own.get();
  if (movers_.used != nullptr) movers_.used->reset();
  if (sensitivities_) sensitivities_->forget_run();
  control_.reset();
  metric_choice_.reset();
  return corrector_.initialize();
}

int Projection::Impl::solve(N_Vector y_predicted, N_Vector ycor, N_Vector weights, double tolerance,
                            bool call_setup, void* mem) {
  if (busy_ == Busy::step)
    return finish(Status::misused, "IDASolve was called from a function that IDA is calling");
  const InUse here(*this, Busy::step);
  ++statistics_.solver_calls;
  polish_.begin();
  if (!run_.initialized)
    return finish(
        Status::late_attach,
        "the Projection was made after IDACalcIC or the first IDASolve, so IDA never handed its "
        "linear solver over; make it between IDAInit and these, or call IDAReInit");

  if (run_.broken) return kFatal;  // status and message keep the exception that broke the run

  Candidate candidate{0.0, y_predicted, ycor, weights};
  if (unknowns_.contiguous) candidate.with_entries();
  if (!run_.engaged || movers_.joined.mover() != nullptr) movers_.joined.begin(candidate);
  corrector_.begin(mem);
  if (movers_.used != nullptr) movers_.used->rows().report.fatal = false;
  control_.restore_weights(weights, attempts_.steps);
  const bool probes = inquiry_ != nullptr;
  int flag = probes ? answer_inquiry(candidate) : step(candidate, tolerance, call_setup);
  if (flag == 0 && !probes) choose_step(candidate);
  // A failed evaluation of the plugin's own does no harm, but a fatal flag ends the run.
  const bool ended =
      corrector_.stopped() || (movers_.used != nullptr && movers_.used->rows().report.fatal);
  if (flag >= 0 && ended) flag = finish(Status::callback_fatal, movers_.used->message());
  return corrector_.stopped() ? corrector_.stop_flag() : flag;
}

void Projection::Impl::choose_step(const Candidate& candidate) {
  const long steps = movers_.used != nullptr ? attempts_.steps : ida_.steps();
  const bool suppressed = run_.suppressed;
  if (in_use(Mechanism::widened_tolerance) && suppressed)
    control_.widen_test(candidate, polish_, attempts_.moved, steps);
  // Nearly dependent rows cause long moves, and a row that F does not keep causes one in every
  // step. Neither is a jump of F.
  const bool long_move = in_use(Mechanism::tested_long_moves) && std::isfinite(attempts_.moved) &&
                         attempts_.moved > options_.advanced.largest_move &&
                         attempts_.moved > kSudden * attempts_.accepted_move &&
                         movers_.used->rows().factors == RowsAt::Factors::of_all_rows;
  control_.control(candidate, steps, run_.engaged, suppressed ? variables_.tested() : nullptr,
                   suppressed ? variables_.id() : nullptr,
                   long_move ? polish_.corrected() : nullptr);
}

int Projection::Impl::caught(Status outcome, const char* text) noexcept {
  run_.broken = true;
  return report_.caught(outcome, text);
}

int Projection::Impl::correct(const Candidate& candidate, double tolerance, bool call_setup) {
  static const std::vector<int> none;
  const bool may_leave_out = run_.engaged && options_.suppress_algebraic;
  corrector_.expect_followers(
      in_use(Mechanism::followers) && may_leave_out && !variables_.high_index() ? variables_.id()
                                                                                : nullptr);
  return corrector_.correct(
      candidate, tolerance, call_setup,
      may_leave_out && in_use(Mechanism::free_multipliers) ? variables_.undetermined() : none);
}

// One attempt at a step: correct, move the candidate onto the constraints, polish (method, section
// 2).
int Projection::Impl::step(Candidate& candidate, double tolerance, bool call_setup) {
  if (const std::optional<int> failed = engage_in_trouble(candidate)) return *failed;
  int flag = correct(candidate, tolerance, call_setup);
  if (movers_.used == nullptr) return flag;
  if (flag != 0) return corrector_failed(candidate, flag);
  const StepData step = ida_.step();
  begin_move(candidate, step);
  if (const std::optional<int> ended = watch_rejections(candidate, step)) return *ended;
  if (!run_.engaged) {
    if (const std::optional<int> done = measure_before_engaging(candidate)) return *done;
    const Status engaged = engage(candidate);
    if (engaged != Status::success) return finish(engaged, movers_.used->message());
  }
  // Reading the clock costs as much as a small projection: the first one is timed, which finds out
  // what the others keep, and every 16th for the others. These see what g is left, too.
  const bool first = tally_.attempts == 0, sampled = tally_.attempts++ % kSampleEvery == 0;
  const auto begin = sampled ? Clock::now() : Clock::time_point();
  bool fresh = call_setup || !corrector_.has_setup();  // of IDA's factors there are no better ones
  Moved move = move_and_polish(candidate, step.cj, tolerance, fresh);
  while (move.status == Status::success && !move.corrector_was_right && !fresh &&
         in_use(Mechanism::repeated_correction)) {
    // A stale Jacobian has fooled IDA's convergence test: correct again with a fresh one.
    ++statistics_.corrections_repeated;
    N_VConst(0.0, candidate.correction);
    flag = correct(candidate, tolerance, true);
    if (flag != 0) return corrector_failed(candidate, flag);
    polish_.note_setup(step.cj);
    fresh = true;
    move = move_and_polish(candidate, step.cj, tolerance, fresh);
  }
  if (sampled) {
    move.drift_after = movers_.used->remaining_drift(candidate);
    if (move.status == Status::success)
      statistics_.largest_drift_after = std::max(statistics_.largest_drift_after, move.drift_after);
    statistics_.seconds += std::chrono::duration<double>(Clock::now() - begin).count() *
                           (first ? 1.0 : static_cast<double>(kSampleEvery));
  }
  account(move, step);
  if (move.status == Status::success) {
    check_start(move);
    check_rows(candidate, step);
  }
  // If moves do not converge C is wrong, as a rule. The cause is diagnosed only if it is printed.
  if (move.status == Status::not_converged && report_.prints_failures(attempts_.steps))
    return finish(move.status,
                  movers_.used->message() +
                      watch_.rejections.suspicion(candidate, corrector_, attempts_.steps));
  return finish(move.status, movers_.used->message());
}

// Prepares the move of a candidate that the corrector has found.
void Projection::Impl::begin_move(Candidate& candidate, const StepData& step) {
  if (!run_.iterative) find_linear_solver_kind();
  account_for_previous_attempt(step);
  candidate.t = step.t;
  if (control_.starts_off_equations(attempts_.steps)) leave_out_of_error_test(false);
  if (!unknowns_.contiguous) return;
  candidate.h = std::abs(ida_.step_size());
  candidate.cj = step.cj;
  candidate.predicted_rate = N_VGetArrayPointer(step.yp_predicted);
}

// `fresh`: IDA's factors cannot be renewed, so that no correction is repeated.
Projection::Impl::Moved Projection::Impl::move_and_polish(const Candidate& candidate, double cj,
                                                          double tolerance, bool fresh) {
  Moved moved;
  polish_.keep(candidate);
  const Fix before =
      polishes_first() ? polish_.add_newton_step(candidate, cj, tolerance, false) : Fix();
  if (in_use(Mechanism::repeated_correction) && !before.corrector_was_right && !fresh) {
    moved.status = Status::success;
    moved.corrector_was_right = false;
    return moved;
  }
  if (before.made) polish_.keep(candidate);
  static_cast<Move&>(moved) = movers_.used->move(candidate);
  if (moved.capped) {
    judge_capped(moved);
    return moved;  // the steps below would make the whole move
  }
  choose_metric(candidate, moved);
  if (moved.status != Status::success) return moved;
  const bool polishes = before.made
                            ? moved.length > polish_.longest_without_response(control_.smoothing())
                            : wants_polish(moved.length);
  // The polish is a refinement: if F or the linear solver fails in it, the move stands. A fatal
  // flag is kept by the corrector and ends the run.
  const Fix after = polishes ? polish_.add_newton_step(candidate, cj, tolerance, true) : Fix();
  moved.corrector_was_right = after.corrector_was_right;
  if (after.made) moved.status = movers_.used->settle(candidate, polish_.delta());
  return moved;
}

// Polishing before the move saves one linear solve: the move removes what the polish violates. The
// response of F to the move is then left out, so that this order is not taken where IDA's error
// test of algebraic variables needs the response.
bool Projection::Impl::polishes_first() {
  if (!in_use(Mechanism::polish_first) ||
      attempts_.last_move > polish_.longest_without_response(control_.smoothing()) ||
      control_.tests_algebraic())
    return false;
  const bool silent = metric_choice_.calm() || !may_change_metric();
  return silent && wants_polish(0.0);
}

// Capped moves approach the constraints step by step from a start off them. A step that ends
// farther away than the last one, by more than the error test allows, has failed.
void Projection::Impl::judge_capped(Move& move) {
  if (move.left <= std::max(1.0, attempts_.left_before)) return;
  move.status = Status::move_too_long;
  movers_.used->rows().report.text =
      "the move onto the constraints, capped at " + brief(move.length) +
      " tolerances (Advanced::largest_move), leaves " + brief(move.left) +
      ", which the error test does not allow; use a larger largest_move";
}

// Whether IDA accepted an attempt shows in its count of steps at the next one.
void Projection::Impl::account_for_previous_attempt(const StepData& step) {
  const long steps = ida_.steps(), setups = ida_.setups();
  if (setups != attempts_.setups) polish_.note_setup(step.cj);
  attempts_.setups = setups;
  attempts_.repeated = steps == attempts_.steps;
  const bool advances = step.t + ida_.step_size() != step.t;
  watch_.rejections.count(attempts_.moved > kPartInTest, attempts_.repeated, advances,
                          attempts_.steps);
  const bool projected = std::isfinite(std::exchange(attempts_.moved, infinite));
  if (!attempts_.repeated) control_.count_refusals(run_.engaged);
  if (!attempts_.repeated && projected) {
    attempts_.left_before = attempts_.left;
    attempts_.accepted_move = attempts_.last_move;
    movers_.used->rows().accept();
    if (options_.progress) {
      attempts_.progress.steps = steps;
      std::string ignored;
      guarded([&] { return options_.progress(attempts_.progress), 0; }, ignored);
    }
  }
  attempts_.steps = steps;
}

void Projection::Impl::account(const Move& move, const StepData& step) {
  Statistics& s = statistics_;
  ++(move.not_needed ? s.skipped : s.projections);
  if (move.capped) ++s.moves_capped;
  if (move.status != Status::success) return;
  s.largest_drift_before = std::max(s.largest_drift_before, move.drift_before);
  s.largest_move = std::max(s.largest_move, move.length);
  tally_.move_sum += move.length;
  attempts_.last_move = move.length;
  attempts_.moved = move.length;
  attempts_.left = move.left;
  if (options_.progress) {
    attempts_.progress = {step.t, ida_.step_size(), ida_.order(), move.drift_before, move.length,
                          0};
  }
}

int Projection::Impl::finish(Status outcome, const std::string& text) {
  if (outcome == Status::success) return report_.finish(outcome, text, attempts_.steps);
  const bool stopped = outcome == Status::callback_fatal && corrector_.stopped();
  const std::string index = stopped ? std::string() : too_high_index();
  if (!index.empty()) return report_.finish(outcome, text + "; " + index, attempts_.steps);
  return report_.finish(outcome, stopped ? corrector_.stop_text() : text, attempts_.steps);
}

}  // namespace tether::ida_projection
