// Tether: the decorator of IDA's nonlinear solver. SPDX-License-Identifier: BSD-3-Clause
//
// IDA asks its nonlinear solver for the correction ycor with y = ypred + ycor, then rebuilds y and
// y' = yppred + cj ycor, and bases its error test, order choice and history on that ycor. Moving
// ycor here, after the decorated solver has converged, therefore is the method of Hanson and
// Krogh: the accepted y lies on the constraints, and so do the points that predict the next step.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include "attach/impl.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kRecoverable = SUN_NLS_CONV_RECVR;  // IDA retries with a quarter of the step
constexpr int kFatal = -1;                        // ends in IDA_NLS_FAIL
constexpr long kSampleEvery = 16;
constexpr long kFirstSteps = 100;        // in which rows and tolerances are looked at
constexpr int kTrapped = 10;             // steps in a row with failed error tests
constexpr int kRefused = 3;              // failed error tests in one step
constexpr int kOftenRefused = 4;         // steps for each failed error test, of the run so far
constexpr double kOnConstraints = 1e-8;  // tolerances; a shorter move is not worth making

bool is_fatal(Status status) { return static_cast<int>(status) < 0; }

}  // namespace

// Called by IDA once tolerances, linear solver and sensitivities are known.
int Projection::Impl::initialize() {
  initialized_ = broken_ = false;
  // IDASetMaxNonlinIters reaches the state's solver unless IDAS solves states and sensitivities
  // together; there is no getter for that. Ask, and see whether the question arrives here.
  // Without constraints nothing would be lost.
  heard_ = false;
  if (mover_) IDASetMaxNonlinIters(ida_mem_, maximum_iterations_);
  if (mover_ && !heard_) {
    finish(Status::simultaneous_sensitivities,
           "IDAS with IDA_SIMULTANEOUS does not use the state's nonlinear solver, so nothing would "
           "be projected; use IDA_STAGGERED in IDASensInit");
    return kFatal;
  }
  initialized_ = true;
  engaged_ = iterative_ = solver_known_ = false;
  options_.metric = wanted_metric_;
  rejections_ = rejections_before_ = window_begin_ = refused_steps_ = 0;
  rejected_in_step_ = collapsed_ = false;
  warning.clear();
  warning_status = Status::success;
  row_doubts_.assign(static_cast<std::size_t>(constraints.total_count()), 0);
  looks_ = small_looks_ = 0;
  failing_step_ = -1;
  left_before_ = std::numeric_limits<double>::infinity();
  high_index_ = index_known_ = false;
  undetermined_.clear();
  failed_corrections_ = 0;
  rounding_fails_ = false;
  weights_factor_ = 1.0;
  pending_ = false;
  last_steps_ = last_setups_ = -1;
  if (own_mover_) mover_ = std::move(own_mover_);
  moved_id_ = OwnedVector();
  if (mover_) mover_->reset();
  smoother_.reset();
  order_limit_.reset();
  frequency_.reset();
  repeated_ = false;
  refused_in_row_ = 0;
  last_error_failures_ = 0;
  return inner_->ops->initialize != nullptr ? SUNNonlinSolInitialize(inner_) : 0;
}

// Times every 16th projection: reading the clock costs as much as a small projection. What drift is
// left is looked at on the same ones.
class Projection::Impl::Stopwatch {
 public:
  explicit Stopwatch(Impl& owner)
      : owner_(owner), running_(owner.statistics_.projections % kSampleEvery == 0) {
    if (running_) begin_ = Clock::now();
  }
  ~Stopwatch() {
    if (!running_) return;
    owner_.timed_.add(std::chrono::duration<double>(Clock::now() - begin_).count());
  }
  bool running() const { return running_; }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  Impl& owner_;
  bool running_;
  Clock::time_point begin_;
};

int Projection::Impl::solve(N_Vector y_predicted, N_Vector ycor, N_Vector weights, double tolerance,
                            bool call_setup, void* mem) {
  ++statistics_.solver_calls;
  extra_iterations_of_last_solve_ = 0;
  if (!initialized_)
    return finish(
        Status::late_attach,
        "the Projection was made after IDA had been initialised, so IDA never handed its linear "
        "solver over; make it before IDACalcIC and the first IDASolve, or call IDAReInit");

  if (broken_) return kFatal;  // status and message are those of the exception

  Candidate candidate{0.0, y_predicted, ycor, weights};
  if (contiguous_) candidate.with_entries();
  present_ = candidate;
  mem_ = mem;
  stop_flag_ = 0;
  if (mover_) mover_->forget_failure();
  restore_weights(weights);
  int flag = attempt(candidate, tolerance, call_setup);
  // Evaluations that only look around may fail, but what asks for the end of the run ends it.
  const bool ended = stop_flag_ < 0 || (mover_ && mover_->fatal());
  if (flag >= 0 && ended) flag = finish(Status::callback_fatal, mover_->message());
  return stop_flag_ < 0 ? stop_flag_ : flag;
}

int Projection::Impl::attempt(Candidate& candidate, double tolerance, bool call_setup) {
  if (probing_) {  // make_consistent wants to look around, not to step
    N_VScale(1.0, candidate.weights, weights_);
    if (!id_) derive_id(candidate);
    probed_ = true;
    return 0;
  }
  const int flag = correct_and_move(candidate, tolerance, call_setup);
  if (flag == 0) control_step(candidate);
  return flag;
}

// F(t, ypred + ycor, yppred + cj ycor) through IDA's own callback; 0, or > 0: it cannot be
// evaluated. Once it asked for the end of the run it is not called again.
int Projection::Impl::residual(N_Vector ycor, N_Vector into) {
  if (stop_flag_ < 0) return stop_flag_;
  const int flag = system_(ycor, into, mem_);
  if (flag < 0) stop(flag, "F, IDA's residual function, returned a negative flag");
  return flag;
}

void Projection::Impl::stop(int flag, const std::string& text) {
  stop_flag_ = flag;
  stop_text_ = text;
}

int Projection::Impl::caught(Status outcome, const char* text) noexcept {
  broken_ = true;
  probing_ = false;
  status = outcome;
  try {
    message = text;
  } catch (...) {  // no memory for the text either
    message.clear();
  }
  if (options_.print_fatal && !printed_) {
    printed_ = true;
    std::fprintf(stderr, "tether: %s: %s\n", to_string(outcome), text);
  }
  return kFatal;
}

// The decorated solver's correction. Where it fails although IDA has already cut the step for that,
// its convergence test from then on leaves out algebraic variables of index 2 or more: their
// rounding, divided by the step, fails it, and nothing but they depends on them.
int Projection::Impl::correct(const Candidate& candidate, double tolerance, bool call_setup) {
  N_Vector weights = candidate.weights;
  if (rounding_fails_ && engaged_ && options_.suppress_algebraic && !undetermined_.empty()) {
    if (!newton_weights_) newton_weights_ = OwnedVector(weights);
    N_VScale(1.0, weights, newton_weights_);
    double* entries = N_VGetArrayPointer(newton_weights_);
    for (const int j : undetermined_) entries[j] = 0.0;
    weights = newton_weights_;
  }
  const int flag = SUNNonlinSolSolve(inner_, candidate.base, candidate.correction, weights,
                                     tolerance, call_setup, mem_);
  failed_corrections_ = flag == 0 ? 0 : failed_corrections_ + 1;
  if (failed_corrections_ >= 2) rounding_fails_ = true;
  return flag;
}

int Projection::Impl::correct_and_move(Candidate& candidate, double tolerance, bool call_setup) {
  if (mover_ && !engaged_ && !index_known_ && in_trouble()) {
    const Status engaged = engage_if_index_is_high(candidate);
    if (engaged != Status::success) return finish(engaged, mover_->message());
  }
  int flag = correct(candidate, tolerance, call_setup);
  if (!mover_) return flag;
  if (flag != 0) return corrector_failed(flag);
  if (!solver_known_) look_at_linear_solver();

  const StepData step = step_data();
  account_for_previous_attempt(step);
  candidate.t = step.t;
  const Candidate& at = candidate;
  if (collapsed_ && warning_status != Status::collapsed) look_for_causes(at, step);
  if (frequency_.on() && !needs_projection(at, step, tolerance)) return finish(Status::success, "");
  const Stopwatch stopwatch(*this);
  if (!engaged_) {
    bool done = false;
    const int outcome = look_before_moving(at, done);
    if (done) return outcome;
  }

  Move move = move_and_polish(at, step.cj, tolerance);
  if (move.status == Status::success && !corrector_was_right_ && !call_setup && has_setup_) {
    // Old factors fooled IDA's convergence test: correct again, with fresh ones.
    ++statistics_.corrections_repeated;
    N_VConst(0.0, at.correction);
    flag = correct(at, tolerance, true);
    if (flag != 0) return corrector_failed(flag);
    cj_at_setup_ = step.cj;
    move = move_and_polish(at, step.cj, tolerance);
  }
  if (stopwatch.running()) move.drift_after = mover_->remaining_drift(at);
  account(move, step, stopwatch.running());
  if (last_steps_ <= kFirstSteps && move.status == Status::success) look_at_first_steps(at, step);
  return finish(move.status, move.capped ? capped_message_ : mover_->message());
}

int Projection::Impl::corrector_failed(int flag) {
  ++statistics_.corrector_failures;
  status = Status::corrector_failed;
  if (high_index_)
    message =
        "IDA's corrector failed; in forms of index 2 or more multipliers carry rounding divided by "
        "the step, which may not allow this tolerance: try a larger one, or a form of index 1 or 0";
  return flag;
}

// Until a first move is needed IDA is left alone, bit for bit. `done`: this attempt is finished.
int Projection::Impl::look_before_moving(const Candidate& candidate, bool& done) {
  const Move first = mover_->measure(candidate);
  if (frequency_.on()) frequency_.looked(first.length, step_size());
  done = true;
  if (first.status != Status::success) {
    const int code = finish(first.status, mover_->message());
    // Before the first step a smaller step cannot cure rows that contradict each other.
    return last_steps_ == 0 && first.status == Status::inconsistent ? kFatal : code;
  }
  if (first.length <= std::max(kOnConstraints, first.floor) && !struggling()) {
    ++statistics_.skipped;
    statistics_.largest_drift_before =
        std::max(statistics_.largest_drift_before, first.drift_before);
    statistics_.largest_drift_after = std::max(statistics_.largest_drift_after, first.drift_before);
    return finish(Status::success, "");
  }
  const Status engaged = engage(candidate);
  if (engaged != Status::success) return finish(engaged, mover_->message());
  done = false;
  return 0;
}

Move Projection::Impl::move_and_polish(const Candidate& candidate, double cj, double tolerance) {
  corrector_was_right_ = true;
  keep_corrector(candidate);
  Move move = mover_->move(candidate);
  if (move.capped) {
    judge_capped(move);
    return move;  // what follows would make the whole move
  }
  if (move.status == Status::success)
    move.status =
        wants_polish(move.length) ? polish(candidate, cj, tolerance) : mover_->finish(candidate);
  return move;
}

// A cap is meant for a start off the constraints, which is approached step by step. A step that
// ends farther away than the last one, by more than the error test allows, has failed.
void Projection::Impl::judge_capped(Move& move) {
  if (move.left <= std::max(1.0, left_before_)) return;
  move.status = Status::move_too_long;
  capped_message_ = "the move onto the constraints, capped at " + std::to_string(move.length) +
                    " tolerances (Options::largest_move), leaves " + std::to_string(move.left) +
                    ", which the error test does not allow; use a larger largest_move";
}

// The corrector's ycor, before the move.
void Projection::Impl::keep_corrector(const Candidate& candidate) {
  if (contiguous_)
    for (int j = 0; j < size_; ++j) newton_entries_[j] = candidate.correction_entries[j];
  else
    N_VScale(1.0, candidate.correction, newton_);
}

StepData Projection::Impl::step_data() const {
  StepData step;
  N_Vector yyn, ypn, res;
  void* user_data;
  sunrealtype t, cj;
  IDAGetNonlinearSystemData(ida_mem_, &t, &step.y_predicted, &step.yp_predicted, &yyn, &ypn, &res,
                            &cj, &user_data);
  step.t = t;
  step.cj = cj;
  return step;
}

// IDA does not tell whether it accepted an attempt; the count of steps does, at the next one.
void Projection::Impl::account_for_previous_attempt(const StepData& step) {
  long steps = 0, setups = 0;
  IDAGetNumSteps(ida_mem_, &steps);
  IDAGetNumLinSolvSetups(ida_mem_, &setups);
  if (setups != last_setups_) cj_at_setup_ = step.cj;
  last_setups_ = setups;
  repeated_ = steps == last_steps_;
  count_rejections();
  if (!repeated_) look_for_refusals();
  if (!repeated_ && pending_) {
    left_before_ = left_;
    mover_->accept();
    if (options_.progress && ++progress_count_ % options_.progress_interval == 0) {
      progress_.steps = steps;
      std::string ignored;
      guarded([&] { return options_.progress(progress_), 0; }, ignored);
    }
  }
  last_steps_ = steps;
  pending_ = false;
}

// There is no getter for the type of IDA's linear solver, but direct ones count no iterations and
// iterative ones, with a Jacobian of their own or without, do from the first right-hand side that
// is not zero.
void Projection::Impl::look_at_linear_solver() {
  long iterations = 0, preconditioners = 0, jacobians = 0;
  IDAGetNumLinIters(ida_mem_, &iterations);
  IDAGetNumPrecEvals(ida_mem_, &preconditioners);
  IDAGetNumJacEvals(ida_mem_, &jacobians);
  iterative_ = iterations > 0 || preconditioners > 0;
  solver_known_ = iterative_ || (jacobians > 0 && last_steps_ > 0);
  if (wanted_metric_ == Metric::automatic)
    options_.metric = iterative_ ? Metric::error_weights : Metric::local_correction;
  mover_->expect_no_settle(iterative_);
}

// IDA may double its step right after a doubling was refused, and raises the order only after k + 2
// steps of one size: one failed error test a step at order 1 can go on for ever.
void Projection::Impl::look_for_refusals() {
  if (smoother_.on()) return;
  long failures = 0;
  IDAGetNumErrTestFails(ida_mem_, &failures);
  refused_in_row_ = failures > last_error_failures_ ? refused_in_row_ + 1 : 0;
  last_error_failures_ = failures;
  if (engaged_ && refused_in_row_ >= kTrapped) begin_smoothing();
}

// Before the first move: does IDA fail on algebraic variables in its error test, which would be
// taken out of it with that move?
bool Projection::Impl::struggling() const {
  if (!options_.suppress_algebraic) return false;
  long failures = 0;
  IDAGetNumErrTestFails(ida_mem_, &failures);
  return refused_in_row_ >= kTrapped || failures - last_error_failures_ >= kRefused;
}

// Before a first move: has the corrector failed, or the error test in a fourth of all steps?
bool Projection::Impl::in_trouble() const {
  if (!options_.suppress_algebraic) return false;
  long failures = 0;
  IDAGetNumErrTestFails(ida_mem_, &failures);
  return statistics_.corrector_failures > 0 ||
         (failures > 1 && kOftenRefused * failures > last_steps_);
}

// Multipliers of index 2 fail the error test until rounding, divided by the step, makes the
// corrector fail: too late for the policy to begin.
Status Projection::Impl::engage_if_index_is_high(const Candidate& candidate) {
  if (options_.id == nullptr && !id_) {
    const Status derived = derive_id(candidate);
    if (derived != Status::success) return derived;
  }
  index_known_ = true;
  high_index_ = index_exceeds_one(candidate);
  return high_index_ && has_algebraic_ ? engage(candidate) : Status::success;
}

void Projection::Impl::begin_smoothing() {
  if (smoother_.on() || !options_.smooth_where_needed) return;
  smoother_.begin();
  ++statistics_.smoothing_begun;
}

// The first move that is needed switches the policy on; until then IDA runs as it would alone.
Status Projection::Impl::engage(const Candidate& candidate) {
  if (options_.id == nullptr && !id_) {
    const Status derived = derive_id(candidate);
    if (derived != Status::success) return derived;
  }
  if (id_ && has_algebraic_ && options_.suppress_algebraic) {
    IDASetId(ida_mem_, id_);
    IDASetSuppressAlg(ida_mem_, 1);
  }
  // Multipliers of higher index answer to a change of h by errors proportional to the change.
  if (!index_known_ && options_.smooth_where_needed) high_index_ = index_exceeds_one(candidate);
  index_known_ = true;
  if (high_index_) begin_smoothing();
  join_equations(candidate);
  if (stop_flag_ < 0) return Status::callback_fatal;
  const Status structured = mover_->set_algebraic(candidate, moved_id());
  engaged_ = structured == Status::success;  // else the next attempt looks again
  return structured;
}

void Projection::Impl::account(const Move& move, const StepData& step, bool sampled) {
  Statistics& s = statistics_;
  ++s.projections;
  if (move.capped) ++s.moves_capped;
  if (move.status != Status::success) return;
  note(move, step);
  if (sampled) s.largest_drift_after = std::max(s.largest_drift_after, move.drift_after);
}

// What a successful move, full or not, leaves in the counts.
void Projection::Impl::note(const Move& move, const StepData& step) {
  Statistics& s = statistics_;
  s.largest_drift_before = std::max(s.largest_drift_before, move.drift_before);
  s.largest_move = std::max(s.largest_move, move.length);
  move_sum_ += move.length;
  if (frequency_.on()) frequency_.looked(move.length, step_size());
  pending_ = true;
  left_ = move.left;
  if (options_.progress) {
    int order = 0;
    IDAGetCurrentOrder(ida_mem_, &order);
    progress_ = {step.t, step_size(), order, move.drift_before, move.length, 0};
  }
}

// Status, text and count of the outcome; the code that IDA wants.
int Projection::Impl::finish(Status outcome, const std::string& text) {
  status = outcome;
  if (outcome == Status::success) {
    if (message != advice_) message = advice_;
    return 0;
  }
  message = outcome == Status::callback_fatal && stop_flag_ < 0 ? stop_text_ : text;
  switch (outcome) {
    case Status::not_converged:
      ++statistics_.not_converged;
      break;
    case Status::move_too_long:
      ++statistics_.move_too_long;
      break;
    case Status::inconsistent:
      ++statistics_.inconsistent;
      break;
    case Status::not_finite:
      ++statistics_.not_finite;
      break;
    case Status::callback_recoverable:
      ++statistics_.callback_recoverable;
      break;
    case Status::callback_fatal:
      ++statistics_.callback_fatal;
      break;
    default:
      break;
  }
  if (is_fatal(outcome) && options_.print_fatal && !printed_) {
    printed_ = true;  // once: IDA reports the failure of the run by itself
    std::fprintf(stderr, "tether: %s: %s\n", to_string(outcome), message.c_str());
  }
  if (!is_fatal(outcome)) count_failure_in_step(text);
  return is_fatal(outcome) ? kFatal : kRecoverable;
}

}  // namespace tether::ida_projection
