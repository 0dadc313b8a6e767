// Tether: the decorator of IDA's nonlinear solver. SPDX-License-Identifier: BSD-3-Clause
//
// IDA asks its nonlinear solver for the correction ycor with y = ypred + ycor, then rebuilds y and
// y' = yppred + cj ycor, and bases its error test, order choice and history on that ycor. Moving
// ycor here, after the decorated solver has converged, therefore is the method of Hanson and
// Krogh: the accepted y lies on the constraints, and so do the points that predict the next step.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <utility>

#include "attach/impl.hpp"
#include "attach/shortest.hpp"
#include "fast/quicken.hpp"
#include "watch/dead_point.hpp"

namespace tether::ida_projection {

namespace {

constexpr long kSampleEvery = 16;
// Multipliers of index 2: see README, section 9.
constexpr double kAsideFromTest = 1.5, kProportional = 1e-4, kMostCare = 5.0, kManyFree = 0.4;
constexpr int kNameAfter = 3;            // failed correctors in a row
constexpr int kRefusedStarts = 5;        // of the ten error tests that IDA tries
constexpr int kFew = 16;                 // times as many unknowns as rows: rows_of_field()
constexpr double kOnConstraints = 1e-8;  // tolerances; a shorter move is not worth making

}  // namespace

// Called by IDA once tolerances, linear solver and sensitivities are known.
int Projection::Impl::initialize() {
  run_.initialized = run_.broken = false;
  // IDASetMaxNonlinIters reaches the state's solver unless IDAS solves states and sensitivities
  // together; there is no getter for that. Ask, and see whether the question arrives here.
  // Without constraints nothing would be lost.
  if (movers_.used != nullptr && !corrector_.is_reached_by(ida_)) {
    finish(Status::simultaneous_sensitivities,
           "IDAS with IDA_SIMULTANEOUS does not use the state's nonlinear solver, so nothing would "
           "be projected; use IDA_STAGGERED in IDASensInit");
    return kFatal;
  }
  run_.initialized = true;
  run_.engaged = false;
  run_.start = OwnedVector();
  run_.undetermined.clear();
  run_.linear_solver = LinearSolverKind();
  options_.metric = wanted_metric_;
  attempts_ = Attempts();
  attempts_.left_before = std::numeric_limits<double>::infinity();
  report_.reset();
  watch_.rejections.reset();
  watch_.first_steps.reset();
  variables_.forget_index();
  movers_.joined.forget();
  movers_.used = movers_.own.get();
  if (movers_.used != nullptr) movers_.used->reset();
  if (sensitivities_) sensitivities_->forget_run();
  control_.reset();
  frequency_.reset();
  metric_choice_.reset();
  return corrector_.initialize();
}

// Times the first projection and every 16th: reading the clock costs as much as a small one, and
// more than a look at rows that need none. What drift is left is looked at on the same ones.
class Projection::Impl::Stopwatch {
 public:
  explicit Stopwatch(Impl& owner) : owner_(owner) {
    if (owner.run_.engaged) start();
  }
  ~Stopwatch() {
    if (!running_) return;
    owner_.tally_.timed.add(std::chrono::duration<double>(Clock::now() - begin_).count());
  }
  bool running() const { return running_; }
  void start() {
    running_ = owner_.tally_.attempts++ % kSampleEvery == 0;
    if (running_) begin_ = Clock::now();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  Impl& owner_;
  bool running_ = false;
  Clock::time_point begin_;
};

int Projection::Impl::solve(N_Vector y_predicted, N_Vector ycor, N_Vector weights, double tolerance,
                            bool call_setup, void* mem) {
  ++statistics_.solver_calls;
  polish_.begin();
  if (!run_.initialized)
    return finish(
        Status::late_attach,
        "the Projection was made after IDA had been initialised, so IDA never handed its linear "
        "solver over; make it before IDACalcIC and the first IDASolve, or call IDAReInit");

  if (run_.broken) return kFatal;  // status and message are those of the exception

  Candidate candidate{0.0, y_predicted, ycor, weights};
  if (unknowns_.contiguous) candidate.with_entries();
  movers_.joined.begin(candidate);
  corrector_.begin(mem);
  if (movers_.used != nullptr) movers_.used->forget_failure();
  control_.restore_weights(weights, attempts_.steps);
  int flag = attempt(candidate, tolerance, call_setup);
  // Evaluations that only look around may fail, but what asks for the end of the run ends it.
  const bool ended = corrector_.stopped() || (movers_.used != nullptr && movers_.used->fatal());
  if (flag >= 0 && ended) flag = finish(Status::callback_fatal, movers_.used->message());
  return corrector_.stopped() ? corrector_.stop_flag() : flag;
}

int Projection::Impl::attempt(Candidate& candidate, double tolerance, bool call_setup) {
  if (inquiry_.probe != Probe::none) {  // make_consistent wants to look around, not to step
    N_VScale(1.0, candidate.weights, unknowns_.weights);
    if (!variables_.known()) derive_id(candidate);
    candidate.t = ida_.step().t;
    project_jointly(candidate);
    inquiry_.probe = Probe::answered;
    return 0;
  }
  const int flag = correct_and_move(candidate, tolerance, call_setup);
  if (flag != 0) return flag;
  const bool suppressed = run_.engaged && options_.suppress_algebraic;
  const long steps = movers_.used != nullptr ? attempts_.steps : ida_.steps();
  control_.control(candidate, steps, run_.engaged, suppressed ? variables_.id() : nullptr);
  return 0;
}

int Projection::Impl::caught(Status outcome, const char* text) noexcept {
  run_.broken = true;
  inquiry_.probe = Probe::none;
  return report_.caught(outcome, text);
}

int Projection::Impl::correct(const Candidate& candidate, double tolerance, bool call_setup) {
  static const std::vector<int> none;
  const bool may_leave_out = run_.engaged && options_.suppress_algebraic;
  corrector_.expect_followers(may_leave_out && !variables_.high_index() ? variables_.id()
                                                                        : nullptr);
  return corrector_.correct(candidate, tolerance, call_setup,
                            may_leave_out ? variables_.undetermined() : none);
}

int Projection::Impl::correct_and_move(Candidate& candidate, double tolerance, bool call_setup) {
  if (attempts_.steps < 0 && movers_.used != nullptr) {
    quicken_vectors(candidate);
    if (unknowns_.contiguous) keep_point_before(candidate, run_.start);
  }
  if (movers_.used != nullptr && !run_.engaged && !variables_.index_known() &&
      control_.in_trouble(attempts_.steps)) {
    const Status engaged = engage_if_index_is_high(candidate);
    if (engaged != Status::success) return finish(engaged, movers_.used->message());
  }
  int flag = correct(candidate, tolerance, call_setup);
  if (movers_.used == nullptr) return flag;
  if (flag != 0) return corrector_failed(candidate, flag);
  if (!run_.linear_solver.known()) look_at_linear_solver();

  const StepData step = ida_.step();
  account_for_previous_attempt(step);
  candidate.t = step.t;
  const Candidate& at = candidate;
  if (watch_.rejections.collapsed() && report_.warning() != Status::collapsed)
    report_.warn(Status::collapsed, watch_.rejections.cause(at, step, variables_, corrector_));
  if (frequency_.on() && !needs_projection(at, step, tolerance)) return finish(Status::success, "");
  Stopwatch stopwatch(*this);
  if (!run_.engaged) {
    bool done = false;
    const int outcome = look_before_moving(at, done);
    if (done) return outcome;
    stopwatch.start();
    const Status engaged = engage(at);
    if (engaged != Status::success) return finish(engaged, movers_.used->message());
  }

  const bool fresh = call_setup || !corrector_.has_setup();
  Move move = move_and_polish(at, step.cj, tolerance, fresh);
  if (move.status == Status::success && !polish_.corrector_was_right() && !fresh) {
    // Old factors fooled IDA's convergence test, or serve no stiff move: correct again, with fresh
    // ones.
    ++statistics_.corrections_repeated;
    N_VConst(0.0, at.correction);
    flag = correct(at, tolerance, true);
    if (flag != 0) return corrector_failed(candidate, flag);
    polish_.note_setup(step.cj);
    move = move_and_polish(at, step.cj, tolerance, true);
  }
  if (stopwatch.running()) move.drift_after = movers_.used->remaining_drift(at);
  account(move, step, stopwatch.running());
  if (move.status == Status::success) {
    look_at_start(move);
    look_for_doubts(at, step);
  }
  if (move.status == Status::not_converged)
    return finish(move.status, with_suspicion(movers_.used->message(), at));
  return finish(move.status, move.capped ? attempts_.capped_message : movers_.used->message());
}

// Moves that do not converge: a wrong C as a rule. Looked into once a step, where it is to be said.
std::string Projection::Impl::with_suspicion(std::string text, const Candidate& candidate) {
  if (!report_.says_failures(attempts_.steps)) return text;
  if (attempts_.suspected != attempts_.steps) {
    attempts_.suspected = attempts_.steps;
    attempts_.suspicion = watch_.rejections.suspicion(candidate, corrector_);
  }
  return std::move(text) + attempts_.suspicion;
}

// From a start off the constraints moves do not shrink with the step. Above Options::largest_move
// they are refused by name, below IDA's error test refuses them, with words of its own.
void Projection::Impl::look_at_start(const Move& move) {
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

void Projection::Impl::look_for_doubts(const Candidate& candidate, const StepData& step) {
  if (attempts_.steps > FirstSteps::kSteps || attempts_.repeated ||
      report_.warning() != Status::success)
    return;
  const std::string doubt =
      watch_.first_steps.look(candidate, step, attempts_.steps, ida_.step_size(),
                              polish_.corrected(), variables_, *movers_.used, corrector_);
  if (!doubt.empty()) report_.warn(Status::doubtful, doubt);
}

// y before this step; of a later one, up to its curvature.
void Projection::Impl::keep_point_before(const Candidate& candidate, OwnedVector& y) {
  if (!y) y = OwnedVector(candidate.base);
  N_VLinearSum(1.0, candidate.base, -ida_.step_size(), ida_.step().yp_predicted, y);
}

std::string Projection::Impl::undetermined_at(const Candidate& candidate, N_Vector y) {
  return undetermined_multipliers(candidate, y, variables_, corrector_, constraints_, statistics_);
}

int Projection::Impl::corrector_failed(const Candidate& candidate, int flag) {
  ++statistics_.corrector_failures;
  report_.status = Status::corrector_failed;
  if (flag > 0 && run_.engaged) control_.corrector_failed();
  if (variables_.high_index())
    report_.message =
        "IDA's corrector failed; in forms of index 2 or more multipliers carry rounding divided by "
        "the step, which may not allow this tolerance: try a larger one, or a form of index 1 or 0";
  if (variables_.high_index() && !run_.undetermined.empty())
    report_.message += "; " + run_.undetermined;
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

// Until a first move is needed IDA is left alone, bit for bit. `done`: this attempt is finished.
int Projection::Impl::look_before_moving(const Candidate& candidate, bool& done) {
  const Move first = movers_.used->measure(candidate);
  if (frequency_.on()) frequency_.projected(first.length, std::abs(ida_.step_size()));
  done = true;
  if (first.status != Status::success) {
    const int code = finish(first.status, movers_.used->message());
    // Before the first step a smaller step cannot cure rows that contradict each other.
    return attempts_.steps == 0 && first.status == Status::inconsistent ? kFatal : code;
  }
  if (first.length <= std::max(kOnConstraints, first.floor) && !control_.struggling()) {
    ++statistics_.skipped;
    statistics_.largest_drift_before =
        std::max(statistics_.largest_drift_before, first.drift_before);
    statistics_.largest_drift_after = std::max(statistics_.largest_drift_after, first.drift_before);
    return finish(Status::success, "");
  }
  done = false;
  return 0;
}

// `fresh`: of IDA's factors there are no better ones.
Move Projection::Impl::move_and_polish(const Candidate& candidate, double cj, double tolerance,
                                       bool fresh) {
  polish_.keep(candidate);
  Move move = movers_.used->move(candidate);
  if (move.capped) {
    judge_capped(move);
    return move;  // the steps below would make the whole move
  }
  const bool stiff = choose_metric(candidate, move);
  if (move.status != Status::success) return move;
  const bool made =
      stiff && stiff_move_.make(candidate, cj, polish_, *movers_.used, !attempts_.repeated);
  if (stiff && !fresh && !stiff_move_.trusted()) {
    polish_.doubt_corrector();
    return move;
  }
  if (made) ++statistics_.stiff_moves;
  if (made)
    move.status = settle_stiff_move(candidate, cj, tolerance);
  else
    move.status = wants_polish(move.length) ? polish(candidate, cj, tolerance)
                                            : movers_.used->finish(candidate);
  return move;
}

Status Projection::Impl::polish(const Candidate& candidate, double cj, double tolerance) {
  // A refinement: where F or the linear solver fails here, the move itself stands, unless the
  // failure is to end the run; then the corrector has kept it.
  return polish_.add_newton_step(candidate, cj, tolerance)
             ? movers_.used->settle(candidate, polish_.delta())
             : movers_.used->finish(candidate);
}

// A cap is meant for a start off the constraints, which is approached step by step. A step that
// ends farther away than the last one, by more than the error test allows, has failed.
void Projection::Impl::judge_capped(Move& move) {
  if (move.left <= std::max(1.0, attempts_.left_before)) return;
  move.status = Status::move_too_long;
  attempts_.capped_message = "the move onto the constraints, capped at " + brief(move.length) +
                             " tolerances (Options::largest_move), leaves " + brief(move.left) +
                             ", which the error test does not allow; use a larger largest_move";
}

// A few invariants of many unknowns, as on grids; rows of mechanisms are many and local.
bool Projection::Impl::rows_of_field() const {
  if (std::holds_alternative<DistributedRows>(constraints_.jacobian)) return false;
  const bool gradients = std::holds_alternative<Gradients>(constraints_.jacobian);
  return gradients || kFew * constraints_.total_count() <= N_VGetLength(unknowns_.weights);
}

void Projection::Impl::look_at_linear_solver() {
  run_.linear_solver.look(ida_, attempts_.steps);
  const bool iterative = run_.linear_solver.iterative();
  if (wanted_metric_ == Metric::automatic)
    options_.metric =
        iterative && rows_of_field() ? Metric::error_weights : Metric::local_correction;
  polish_.note_linear_solver(iterative);
  movers_.used->expect_no_settle(iterative);
}

// IDA does not tell whether it accepted an attempt; the count of steps does, at the next one.
void Projection::Impl::account_for_previous_attempt(const StepData& step) {
  const long steps = ida_.steps(), setups = ida_.setups();
  if (setups != attempts_.setups) polish_.note_setup(step.cj);
  attempts_.setups = setups;
  attempts_.repeated = steps == attempts_.steps;
  watch_.rejections.count(attempts_.repeated, attempts_.steps);
  if (!attempts_.repeated) control_.look_for_refusals(run_.engaged);
  if (!attempts_.repeated && attempts_.pending) {
    attempts_.left_before = attempts_.left;
    movers_.used->accept();
    if (options_.progress && ++tally_.progress_count % options_.progress_interval == 0) {
      tally_.progress.steps = steps;
      std::string ignored;
      guarded([&] { return options_.progress(tally_.progress), 0; }, ignored);
    }
  }
  attempts_.steps = steps;
  attempts_.pending = false;
}

// Readable through message() as long as nothing else is wrong.
void Projection::Impl::derive_id(const Candidate& candidate) {
  const std::string unknown = variables_.derive(candidate, corrector_, ida_.step().cj);
  if (!unknown.empty())
    report_.advice = "algebraic variables were not derived (" + unknown +
                     ") and stay in the error test; give IDA's id vector in Options::id";
}

// Multipliers of index 2 fail the error test until rounding, divided by the step, makes the
// corrector fail: too late for the policy to begin.
Status Projection::Impl::engage_if_index_is_high(const Candidate& candidate) {
  if (!variables_.known()) derive_id(candidate);
  variables_.look_at_index(candidate, corrector_, ida_.step().cj, ida_.evaluations_for_jacobian());
  return variables_.high_index() && variables_.any() ? engage(candidate) : Status::success;
}

// By how much more than smoothing_setpoint errors are kept below the tolerance. Those at the end
// follow (tolerance / s)^(k/(k+1)), k the order; s that grows by its (-1/k)-th power, k = 5, makes
// them follow the tolerance. Rows that leave few directions free take most of the errors with them.
double Projection::Impl::care_of_high_index(const Candidate& candidate) const {
  const N_Vector id = variables_.id();
  if (variables_.undetermined().empty()) return kAsideFromTest;
  const double differential = N_VDotProd(id, id);
  if (constraints_.total_count() > (1.0 - kManyFree) * differential) return kAsideFromTest;
  const double unknowns = N_VWrmsNormMask(candidate.base, candidate.weights, id);  // in tolerances
  const double tighter = std::pow(kProportional * unknowns, 0.2);
  return kAsideFromTest * std::clamp(tighter, 1.0, kMostCare);
}

// Those of IDA's vectors that pass through here, and the plugin's own; the caller's are left alone.
void Projection::Impl::quicken_vectors(const Candidate& candidate) {
  N_Vector newton = nullptr;
  if (options_.nonlinear_solver == nullptr)
    newton = static_cast<SUNNonlinearSolverContent_Newton>(corrector_.inner()->content)->delta;
  const StepData step = ida_.step();
  fast::quicken({candidate.correction, step.residual, polish_.delta()});
  fast::quicken_with_inputs({step.y_predicted, step.yp_predicted, candidate.weights, newton});
}

// The first move that is needed switches the policy on; until then IDA runs as it would alone.
Status Projection::Impl::engage(const Candidate& candidate) {
  if (!variables_.known()) derive_id(candidate);
  if (variables_.any() && options_.suppress_algebraic) {
    IDASetId(ida_.mem(), variables_.id());
    IDASetSuppressAlg(ida_.mem(), 1);
  }
  const double cj = ida_.step().cj;
  // Multipliers of higher index answer to a change of h by errors proportional to the change.
  if (options_.smooth_where_needed)
    variables_.look_at_index(candidate, corrector_, cj, ida_.evaluations_for_jacobian());
  else
    variables_.note_index_as_low();
  const bool given = options_.id != nullptr;
  const std::string doubts = given ? variables_.doubts(candidate, corrector_, cj) : std::string();
  if (!doubts.empty()) report_.warn(Status::doubtful, doubts);
  if (variables_.high_index()) {
    control_.begin_smoothing(care_of_high_index(candidate));
    const std::string found = run_.start ? undetermined_at(candidate, run_.start) : std::string();
    if (!found.empty() && doubts.empty()) {
      run_.undetermined = "the motion from the start is not determined: there " + found;
      report_.warn(Status::doubtful, run_.undetermined);
    }
  }
  movers_.joined.join(candidate, cj);
  movers_.used = movers_.joined.mover() != nullptr ? movers_.joined.mover() : movers_.own.get();
  if (corrector_.stopped()) return Status::callback_fatal;
  const Status structured = movers_.used->set_algebraic(candidate, movers_.joined.moved_id());
  run_.engaged = structured == Status::success;  // else the next attempt looks again
  return structured;
}

void Projection::Impl::account(const Move& move, const StepData& step, bool sampled) {
  Statistics& s = statistics_;
  ++(move.looked ? s.skipped : s.projections);
  if (move.capped) ++s.moves_capped;
  if (move.status != Status::success) return;
  if (frequency_.on()) frequency_.projected(move.length, std::abs(ida_.step_size()));
  note(move, step);
  if (sampled) s.largest_drift_after = std::max(s.largest_drift_after, move.drift_after);
}

// Counts of a successful move, full or not.
void Projection::Impl::note(const Move& move, const StepData& step) {
  Statistics& s = statistics_;
  s.largest_drift_before = std::max(s.largest_drift_before, move.drift_before);
  s.largest_move = std::max(s.largest_move, move.length);
  tally_.move_sum += move.length;
  attempts_.pending = true;
  attempts_.left = move.left;
  if (options_.progress) {
    tally_.progress = {step.t, ida_.step_size(), ida_.order(), move.drift_before, move.length, 0};
  }
}

int Projection::Impl::finish(Status outcome, const std::string& text) {
  const bool stopped = outcome == Status::callback_fatal && corrector_.stopped();
  return report_.finish(outcome, stopped ? corrector_.stop_text() : text, attempts_.steps);
}

}  // namespace tether::ida_projection
