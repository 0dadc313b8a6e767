// Tether: a projected step of IDA. SPDX-License-Identifier: BSD-3-Clause
//
// IDA's nonlinear solver returns the correction ycor. IDA then forms y = ypred + ycor and
// y' = yppred + cj ycor, and bases its error test, order and history on ycor. Moving ycor here,
// after the decorated solver has converged, is the method of Hanson and Krogh (method, section 2):
// the accepted y lies on the constraints, and so do the points that predict the next step.
#include <algorithm>
#include <cmath>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <utility>

#include "attach/impl.hpp"
#include "fast/kernels.hpp"
#include "host/mechanisms.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kSudden = 10.0;  // times the last accepted move: longer ones follow a jump of F
constexpr int kFew = 16;          // unknowns per row from which on rows are few

}  // namespace

// IDA calls this once tolerances, linear solver and sensitivities are known.
int Projection::Impl::initialize() {
  run_.phase = Phase::late;
  // If IDAS solves states and sensitivities together it bypasses this solver, and no getter tells
  // so. IDASetMaxNonlinIters is called to see whether it arrives here. Without constraints
  // nothing would be lost.
  if (rows_.used != nullptr && !corrector_.is_reached_by(ida_)) {
    finish(Status::simultaneous_sensitivities,
           "IDAS with IDA_SIMULTANEOUS does not use the state's nonlinear solver, so nothing would "
           "be projected; use IDA_STAGGERED in IDASensInit");
    return kFatal;
  }
  // Algebraic variables return to IDA's error test. Where the caller gives Options::id he may have
  // called IDASetSuppressAlg as well, which no getter tells, so that nothing is changed.
  if (run_.suppressed && options_.id == nullptr) control_.test_all(variables_.vector());
  run_ = Run();
  run_.phase = Phase::watching;
  options_.advanced.metric = wanted_metric_;
  history_.reset();
  present_ = Candidate();
  report_.reset();
  observer_.reset();
  variables_.begin_run();
  rows_.joined.forget();
  rows_.used = rows_.own.get();
  if (rows_.used != nullptr) rows_.used->reset();
  if (sensitivities_) sensitivities_->forget_run();
  control_.reset();
  metric_choice_.reset();
  return corrector_.initialize();  // all variables are in the convergence test again
}

int Projection::Impl::solve(N_Vector y_predicted, N_Vector ycor, N_Vector weights, double tolerance,
                            bool call_setup, void* mem) {
  if (busy_ == Busy::step)
    return finish(Status::misused, "IDASolve was called from a function that IDA is calling");
  const InUse here(*this, Busy::step);
  ++statistics_.solver_calls;
  polish_.begin();
  if (run_.phase == Phase::late)
    return finish(
        Status::late_attach,
        "the Projection was made after IDACalcIC or the first IDASolve, so IDA never handed its "
        "linear solver over; make it between IDAInit and these, or call IDAReInit");
  if (run_.phase == Phase::broken)
    return kFatal;  // status and message keep the exception that broke the run

  const Attempt attempt = history_.begin(ida_);
  Candidate& candidate = present_;
  if (y_predicted != candidate.base || ycor != candidate.correction || weights != candidate.weights)
    note_vectors(y_predicted, ycor, weights);
  candidate.t = attempt.t;
  candidate.cj = attempt.cj;
  candidate.h = std::abs(attempt.h);
  RowsAt* const rows = rows_.used;
  if (rows_.joined.rows() != nullptr) rows_.joined.begin(candidate);
  corrector_.begin(mem);
  if (rows != nullptr) rows->report.fatal = false;
  control_.restore_weights(weights, history_.rejected(attempt));
  const int flag = start_.asks() ? answer(candidate) : step(attempt, tolerance, call_setup);
  // A failed evaluation of the plugin's own does no harm, but a fatal flag ends the run.
  if (corrector_.stopped() || (rows_.used != nullptr && rows_.used->report.fatal)) {
    const int code = flag < 0 ? flag : finish(Status::callback_fatal, rows_.used->report.text);
    return corrector_.stopped() ? corrector_.stop_flag() : code;
  }
  return flag;
}

// IDA's vectors of the attempts. They and their entries stay where they are in a run.
void Projection::Impl::note_vectors(N_Vector y_predicted, N_Vector ycor, N_Vector weights) {
  present_ = {0.0, y_predicted, ycor, weights, ida_.step().yp_predicted};
  if (unknowns_.contiguous) present_.with_entries();
}

// For initial values, which no step leads to.
int Projection::Impl::answer(Candidate candidate) {
  candidate.h = 0.0;
  candidate.predicted_slope = nullptr;
  candidate.predicted_rate = nullptr;
  report_.advise(start_.answer(candidate));
  return 0;
}

// One attempt at a step: correct, move the candidate onto the constraints, polish (method, section
// 2). Returns the code for IDA. Until a first move is needed the run is that of IDA, bit for bit.
int Projection::Impl::step(const Attempt& attempt, double tolerance, bool call_setup) {
  const Candidate& candidate = present_;
  if (rows_.used == nullptr) {
    const int flag = corrector_.correct(candidate, tolerance, call_setup);
    return flag != 0 ? flag : hand_over(attempt, candidate, infinite);
  }
  if (history_.steps() < 0) begin_run(candidate);
  if (!engaged() && in_trouble(attempt, candidate)) {
    const Status begun = engage(candidate);
    if (begun != Status::success) return finish(begun, rows_.used->report.text);
  }
  int flag = corrector_.correct(candidate, tolerance, call_setup);
  if (flag != 0) return corrector_failed(candidate, flag);
  if (!begin_attempt(attempt, candidate)) return report_.end(Status::collapsed);
  if (!engaged()) {
    bool moves = false;
    flag = begin_moves(attempt, &moves);
    if (flag != 0 || !moves) return flag;
  }
  observer_.begin_move();
  bool fresh = call_setup || !corrector_.has_setup();  // IDA's factors cannot be better
  Moved move;
  for (;;) {
    move = move_and_polish(candidate, tolerance, fresh);
    if (move.status != Status::success || move.fix != Fix::misled || fresh ||
        !in_use(Mechanism::repeated_correction))
      break;
    // A stale Jacobian has fooled IDA's convergence test: correct again with a fresh one.
    ++statistics_.corrections_repeated;
    N_VConst(0.0, candidate.correction);
    flag = corrector_.correct(candidate, tolerance, true);
    if (flag != 0) return corrector_failed(candidate, flag);
    polish_.note_setup(attempt.cj);
    fresh = true;
  }
  observer_.after_move(attempt, candidate, move, polish_.corrected(), *rows_.used);
  if (move.status != Status::success)
    return finish(move.status,
                  rows_.used->report.text + observer_.suspicion(attempt, candidate, move.status));
  run_.last_move = move.length;
  run_.left = move.left;
  return hand_over(attempt, candidate, move.length);
}

// Before the first move: whether this attempt needs one. Returns the code for IDA.
int Projection::Impl::begin_moves(const Attempt& attempt, bool* needed) {
  const Candidate& candidate = present_;
  const Move first = rows_.used->measure(candidate);
  if (first.status != Status::success) {
    const int code = finish(first.status, rows_.used->report.text);
    // In the first step rows that contradict each other do so at every step size.
    return attempt.steps == 0 && first.status == Status::inconsistent ? kFatal : code;
  }
  if (first.length <= std::max(kNothing, first.floor) && !control_.struggling(attempt)) {
    observer_.skipped(first);
    return hand_over(attempt, candidate, infinite);
  }
  const Status begun = engage(candidate);
  if (begun != Status::success) return finish(begun, rows_.used->report.text);
  *needed = true;
  return 0;
}

// IDA will judge this attempt. `moved`: the length of the move; infinity: none was made.
int Projection::Impl::hand_over(const Attempt& attempt, const Candidate& candidate, double moved) {
  run_.handed_move = moved;
  // Nearly dependent rows cause long moves, and a row that F does not keep causes one in every
  // step. Neither is a jump of F.
  const bool sudden = in_use(Mechanism::tested_long_moves) && std::isfinite(moved) &&
                      moved > options_.advanced.largest_move &&
                      moved > kSudden * run_.accepted_move &&
                      rows_.used->factors == RowsAt::Factors::of_all_rows;
  control_.choose_step(attempt, candidate, polish_, moved,
                       run_.suppressed ? variables_.tested() : nullptr,
                       run_.suppressed ? variables_.id() : nullptr,
                       sudden ? polish_.corrected() : nullptr, rows_.used);
  history_.hand_over(attempt);
  return report_.succeed();
}

// Gives fast kernels to IDA's vectors that pass through here and to the plugin's own, before the
// first attempt of a run. Vectors of the caller stay as they are.
void Projection::Impl::begin_run(const Candidate& candidate) {
  N_Vector newton = nullptr;
  if (options_.nonlinear_solver == nullptr)
    newton = static_cast<SUNNonlinearSolverContent_Newton>(corrector_.inner()->content)->delta;
  fast::quicken({candidate.correction, ida_.step().residual}, false);
  polish_.quicken();
  fast::quicken({candidate.base, candidate.predicted_slope, candidate.weights, newton}, true);
  observer_.begin_run(candidate);
}

// Before the first move, where steps fail: whether F is of index 2 or more. Its multipliers fail
// the error test at every step size; steps would shrink until rounding, divided by the step, makes
// the corrector fail.
bool Projection::Impl::in_trouble(const Attempt& attempt, const Candidate& candidate) {
  const bool may_be_high = !variables_.index_known() || variables_.high_index();
  if (!may_be_high || !in_use(Mechanism::index_in_trouble) || !control_.in_trouble(attempt))
    return false;
  report_.advise(variables_.derive(candidate, corrector_));
  variables_.find_index(candidate, corrector_, ida_.evaluations_for_jacobian());
  return variables_.high_index() && variables_.any();
}

int Projection::Impl::corrector_failed(const Candidate& candidate, int flag) {
  if (flag > 0) control_.corrector_failed();
  if (flag > 0 && corrector_.multipliers().acts() && corrector_.fails_anyway())
    corrector_.multipliers().allow(polish_.response_to_rounding(candidate));
  polish_.corrector_failed();
  observer_.corrector_failed(candidate, flag);
  return flag;
}

// Judges the last attempt, once this one has a candidate. False: the run is hopeless.
inline bool Projection::Impl::begin_attempt(const Attempt& attempt, const Candidate& candidate) {
  history_.found(attempt);
  if (!run_.iterative) find_linear_solver_kind(attempt.steps);
  const long setups = ida_.setups();
  if (std::exchange(run_.setups, setups) != setups) polish_.note_setup(attempt.cj);
  control_.begin_attempt(attempt, engaged());
  if (std::isfinite(std::exchange(run_.handed_move, infinite)) && attempt.accepted) {
    run_.left_before = run_.left;
    run_.accepted_move = run_.last_move;
    rows_.used->accept();
  }
  if (attempt.steps == 0 && control_.starts_off_equations(attempt)) leave_out_of_error_test(false);
  return observer_.begin_attempt(attempt, candidate);
}

// No getter tells the type of IDA's linear solver. Only iterative solvers count iterations, from
// the first nonzero right-hand side on.
void Projection::Impl::find_linear_solver_kind(long steps) {
  long iterations = 0, preconditioners = 0, jacobians = 0;
  IDAGetNumLinIters(ida_.mem(), &iterations);
  IDAGetNumPrecEvals(ida_.mem(), &preconditioners);
  IDAGetNumJacEvals(ida_.mem(), &jacobians);
  const bool iterative = iterations > 0 || preconditioners > 0;
  if (iterative || (jacobians > 0 && steps > 1)) run_.iterative = iterative;
  polish_.note_linear_solver(iterative);
  if (wanted_metric_ != Metric::automatic) return;
  // Rows that are a few invariants of many unknowns, as of a field on a grid. Rows of mechanisms
  // are many and local.
  const bool of_field = !std::holds_alternative<DistributedRows>(constraints_.jacobian) &&
                        (std::holds_alternative<Gradients>(constraints_.jacobian) ||
                         kFew * constraints_.total_count() <= N_VGetLength(unknowns_.weights));
  options_.advanced.metric =
      iterative && of_field ? Metric::error_weights : Metric::local_correction;
}

// Switches the policy on: IDA's settings stay as they are until the first move is needed.
Status Projection::Impl::engage(const Candidate& candidate) {
  report_.advise(variables_.derive(candidate, corrector_));
  // Multipliers of index 2 respond to a change of h by errors in proportion to that change.
  if (options_.advanced.smooth_where_needed || (options_.suppress_algebraic && variables_.any()))
    variables_.find_index(candidate, corrector_, ida_.evaluations_for_jacobian());
  else
    variables_.note_index_as_low();
  leave_out_of_error_test(true);
  if (variables_.high_index())
    control_.begin_smoothing(
        stricter_in_index_2(candidate, variables_, constraints_.total_count()));
  observer_.check_form(candidate);
  if (in_use(Mechanism::joined_equations)) rows_.joined.join(candidate);
  rows_.used = rows_.joined.rows() != nullptr ? rows_.joined.rows() : rows_.own.get();
  if (corrector_.stopped()) return Status::callback_fatal;
  const Status structured =
      rows_.used->set_algebraic(candidate, rows_.joined.moved_id(), rows_.joined.repeats());
  if (structured != Status::success) return structured;  // the next attempt tries again
  run_.phase = Phase::engaged;
  run_.other_metric = wanted_metric_ == Metric::automatic && in_use(Mechanism::other_metric) &&
                      options_.group.empty() && rows_.used == rows_.own.get() &&
                      rows_.used->may_use_levels() && unknowns_.contiguous;
  if (!options_.suppress_algebraic) return structured;
  if (in_use(Mechanism::followers) && !variables_.high_index())
    corrector_.wait(variables_.any() ? Corrector::Wait::always : Corrector::Wait::after_failures);
  if (in_use(Mechanism::multipliers_apart)) corrector_.judge_apart(variables_.undetermined());
  return structured;
}

// `coupled`: variables of index 1 stay in it.
void Projection::Impl::leave_out_of_error_test(bool coupled) {
  if (!options_.suppress_algebraic || !variables_.choose_tested(coupled)) return;
  const N_Vector tested = variables_.tested();
  control_.suppress_others(tested, variables_.coupled());
  run_.suppressed = true;
  statistics_.untested =
      std::lround(static_cast<double>(N_VGetLength(tested)) - N_VDotProd(tested, tested));
}

// `fresh`: IDA's factors cannot be renewed, so that no correction is repeated.
TETHER_INLINE Projection::Impl::Moved Projection::Impl::move_and_polish(const Candidate& candidate,
                                                                        double tolerance,
                                                                        bool fresh) {
  Moved moved;
  const auto polish = [&](bool after_the_move) {
    return polish_.add_newton_step(candidate, candidate.cj, tolerance, after_the_move);
  };
  const Fix before = polishes_first() ? polish(false) : Fix::none;
  if (in_use(Mechanism::repeated_correction) && before == Fix::misled && !fresh) {
    moved.status = Status::success;
    moved.fix = before;
    return moved;
  }
  polish_.keep(candidate);
  Move& move = moved;
  move = rows_.used->move(candidate);
  // Rows that touch each other have no common point next to the one where they do.
  while (move.status == Status::not_converged && rows_.used->leave_out_weakest()) {
    polish_.restore(candidate);
    move = rows_.used->move(candidate);
  }
  if (move.capped) {
    judge_capped(move);
    return moved;  // the steps below would make the whole move
  }
  if (move.status == Status::success && may_change_metric()) {
    const bool by_levels = metric_choice_.by_levels();
    move = metric_choice_.improved(candidate, move, *rows_.used, polish_, variables_.high_index());
    if (by_levels != metric_choice_.by_levels() && in_use(Mechanism::expected_oscillations))
      control_.expect_oscillations();
  }
  if (move.status != Status::success) return moved;
  const bool polishes = before != Fix::none
                            ? move.length > polish_.longest_without_response(control_.smoothing())
                            : polish_.wanted(move.length, control_.smoothing());
  // The polish is a refinement: if F or the linear solver fails in it, the move stands. A fatal
  // flag is kept by the corrector and ends the run.
  if (polishes) moved.fix = polish(true);
  if (moved.fix != Fix::none) move.status = rows_.used->settle(candidate, polish_.delta());
  return moved;
}

// Polishing before the move saves one linear solve: the move removes what the polish violates. The
// response of F to the move is then left out, so that this order is not taken where IDA's error
// test of algebraic variables needs the response.
TETHER_INLINE bool Projection::Impl::polishes_first() const {
  return in_use(Mechanism::polish_first) &&
         run_.last_move <= polish_.longest_without_response(control_.smoothing()) &&
         !control_.tests_algebraic() && (metric_choice_.calm() || !may_change_metric()) &&
         polish_.wanted(0.0, control_.smoothing());
}

// Whether the metric may be changed and the response of F is available. At singular positions,
// where rows are nearly dependent, F responds to any move, stiff or not.
bool Projection::Impl::may_change_metric() const {
  return run_.other_metric && rows_.used->factors == RowsAt::Factors::of_all_rows &&
         options_.advanced.metric == Metric::local_correction && polish_.is_response_available();
}

// Capped moves approach the constraints step by step from a start off them. A step that ends
// farther away than the last one, by more than the error test allows, has failed.
void Projection::Impl::judge_capped(Move& move) {
  if (move.left <= std::max(1.0, run_.left_before)) return;
  move.status = Status::move_too_long;
  rows_.used->report.text = "the move onto the constraints, capped at " + brief(move.length) +
                            " tolerances (Advanced::largest_move), leaves " + brief(move.left) +
                            ", which the error test does not allow; use a larger largest_move";
}

int Projection::Impl::caught(Status outcome, const char* text) noexcept {
  run_.phase = Phase::broken;
  return report_.caught(outcome, text);
}

int Projection::Impl::finish(Status outcome, const std::string& text) {
  return report_.finish(outcome, observer_.explained(outcome, text), history_.steps());
}

}  // namespace tether::ida_projection
