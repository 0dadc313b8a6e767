// Tether: the decorator of IDA's nonlinear solver. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <new>
#include <string>
#include <sundials/sundials_nonlinearsolver.h>
#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "host/ida_lifetime.hpp"
#include "host/sampled_time.hpp"
#include "movers/mover.hpp"
#include "rows/equations.hpp"
#include "start/gauss_newton.hpp"
#include "step/frequency.hpp"
#include "step/order_limit.hpp"
#include "step/step_smoothing.hpp"

namespace tether::ida_projection {

/// An N_Vector owned by the plugin; null when empty.
class OwnedVector {
 public:
  OwnedVector() = default;
  /// Throws std::bad_alloc where the vector cannot be cloned.
  explicit OwnedVector(N_Vector like) {
    if (like == nullptr) return;
    // N_VClone writes into what it gets, null or not.
    v_ = like->ops->nvclone(like);
    if (v_ == nullptr) throw std::bad_alloc();
    v_->sunctx = like->sunctx;
  }
  ~OwnedVector() {
    if (v_ != nullptr) N_VDestroy(v_);
  }
  OwnedVector(OwnedVector&& other) noexcept : v_(std::exchange(other.v_, nullptr)) {}
  OwnedVector& operator=(OwnedVector&& other) noexcept {
    std::swap(v_, other.v_);
    return *this;
  }
  OwnedVector(const OwnedVector&) = delete;
  OwnedVector& operator=(const OwnedVector&) = delete;
  operator N_Vector() const { return v_; }

 private:
  N_Vector v_ = nullptr;
};

/// A nonlinear solver that the plugin frees, our own by the second one.
struct FreeSolver {
  void operator()(SUNNonlinearSolver solver) const { SUNNonlinSolFree(solver); }
};
struct FreeEmptySolver {
  void operator()(SUNNonlinearSolver solver) const { SUNNonlinSolFreeEmpty(solver); }
};
template <class Free>
using SolverOwner = std::unique_ptr<std::remove_pointer_t<SUNNonlinearSolver>, Free>;

/// What IDA's public getters tell inside a solve.
struct StepData {
  double t = 0.0, cj = 0.0;
  N_Vector y_predicted = nullptr, yp_predicted = nullptr;
};

/// Is this vector contiguous and whole in this process's memory?
bool is_contiguous(N_Vector v);
/// Throws std::invalid_argument("Projection: " + text).
[[noreturn]] void reject(const std::string& text);
/// The nonlinear solver that IDA sees; its operations call `implementation`.
SUNNonlinearSolver make_solver(Projection::Impl& implementation, SUNNonlinearSolver inner,
                               SUNContext context);
/// Rejects what cannot work, naming the option, its value and what would be right.
void validate(const Constraints& constraints, const Options& options, N_Vector like);

class Projection::Impl {
 public:
  Impl(void* ida_mem, Constraints constraints, Options options);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  ConsistencyReport make_consistent(double t0, N_Vector yy, N_Vector yp, const Consistency& how);
  ConsistencyReport project(double t, N_Vector yy, N_Vector yp);
  int solve_and_project(double tout, double* tret, N_Vector yret, N_Vector ypret, int itask);

  void look_for_bypass();  // bypass.cpp
  Statistics statistics();
  void reset_statistics();

  // The operations of SUNNonlinearSolver that IDA calls (decorator.cpp).
  int initialize();
  int solve(N_Vector y_predicted, N_Vector ycor, N_Vector weights, double tolerance,
            bool call_setup, void* mem);
  SUNNonlinearSolver inner() const { return inner_; }
  void set_system(SUNNonlinSolSysFn f) { system_ = f; }
  void set_linear_solve(SUNNonlinSolLSolveFn f) { linear_solve_ = f; }
  void set_has_setup(bool has) { has_setup_ = has; }
  void note_maximum_iterations(int n) {
    maximum_iterations_ = n;
    heard_ = true;
  }
  /// The code that IDA gets for an exception, which must not pass through its C functions.
  int caught(Status outcome, const char* text) noexcept;
  long extra_iterations_of_last_solve() const { return extra_iterations_of_last_solve_; }
  long extra_iterations() const { return statistics_.extra_iterations; }

  Status status = Status::unused;
  std::string message;
  std::string warning;  // what makes IDA reject most steps or results doubtful, once it was seen
  Status warning_status = Status::success;
  std::string advice_;  // what message() says while nothing is wrong
  Constraints constraints;

 private:
  class Stopwatch;
  // decorator.cpp: the stages of a projected step
  int attempt(Candidate& candidate, double tolerance, bool call_setup);
  int residual(N_Vector ycor, N_Vector into);
  bool solve_linear(N_Vector rhs);
  void stop(int flag, const std::string& text);
  int correct(const Candidate& candidate, double tolerance, bool call_setup);
  int correct_and_move(Candidate& candidate, double tolerance, bool call_setup);
  StepData step_data() const;
  void account_for_previous_attempt(const StepData& step);
  void look_for_refusals();
  void look_at_linear_solver();
  bool struggling() const;
  bool in_trouble() const;
  Status engage_if_index_is_high(const Candidate& candidate);
  void begin_smoothing();
  int corrector_failed(int flag);
  int look_before_moving(const Candidate& candidate, bool& done);
  Status engage(const Candidate& candidate);
  Move move_and_polish(const Candidate& candidate, double cj, double tolerance);
  void judge_capped(Move& move);
  void keep_corrector(const Candidate& candidate);
  bool wants_polish(double length) const;  // polish.cpp
  Status polish(const Candidate& candidate, double cj, double tolerance);
  bool add_newton_step(const Candidate& candidate, double cj, double tolerance);
  bool newton_step_at_moved_point(const Candidate& candidate);
  double differential_length(const Candidate& candidate);
  void apply_delta(const Candidate& candidate, double differential, double algebraic);
  void account(const Move& move, const StepData& step, bool sampled);
  void note(const Move& move, const StepData& step);
  int finish(Status outcome, const std::string& text);

  // step_control.cpp
  void restore_weights(N_Vector weights);
  double error_norm(N_Vector v, N_Vector weights) const;
  void control_step(const Candidate& candidate);
  void compare_slopes(const Candidate& candidate, long steps);

  // collapse.cpp
  void count_rejections();
  void say_once(const std::string& text);
  void look_for_causes(const Candidate& candidate, const StepData& step);
  std::string suspected_row(const Candidate& candidate, const StepData& step);
  std::string squared_row(const Candidate& candidate);
  void warn(Status kind, const std::string& text);

  // first_steps.cpp
  void look_at_first_steps(const Candidate& candidate, const StepData& step);
  void look_for_false_rows(const Candidate& candidate, const StepData& step);
  void look_at_tolerances(const Candidate& candidate, const StepData& step);
  std::string wrong_entry(double t);
  std::string false_row(int row, const Tangency& seen, const StepData& step);
  void count_failure_in_step(const std::string& text);

  // between.cpp
  bool needs_projection(const Candidate& candidate, const StepData& step, double tolerance);
  bool leave_alone(const Candidate& candidate, const StepData& step, double tolerance);
  bool follow(const Candidate& candidate, const StepData& step, double tolerance);
  double step_size() const;

  // algebraic.cpp
  Status derive_id(const Candidate& candidate);
  void set_id(N_Vector id);
  void advise(const std::string& reason);
  void join_equations(const Candidate& candidate);
  std::vector<char> derivative_free_equations(const Candidate& candidate);
  bool residual_at(const double* y, double* f);
  N_Vector moved_id() const;
  bool index_exceeds_one(const Candidate& candidate);  // index.cpp

  void attach();                      // projection.cpp
  long steps_without_plugin() const;  // bypass.cpp

  // consistency.cpp
  bool probe(double t0, N_Vector yy, N_Vector yp);
  void current_weights(N_Vector y);
  void project_point(double t, N_Vector y, const std::vector<bool>& hold, N_Vector id,
                     ConsistencyReport& report);

  void* ida_mem_;
  Options options_;
  StepSmoother smoother_;
  OrderLimit order_limit_;
  OwnedVector kept_slope_;  // y' of a step, for the order
  FrequencyPolicy frequency_;
  long rejections_ = 0, rejections_before_ = 0;  // attempts that IDA repeated
  long window_begin_ = 0;                        // accepted steps when they were last looked at
  long refused_steps_ = 0;                       // of these, steps with a rejection
  bool rejected_in_step_ = false, collapsed_ = false;
  long failing_step_ = -1;
  int failures_in_step_ = 0;
  bool said_failures_ = false;
  Status said_warning_ = Status::success;
  Tangency tangency_;                      // of the caller's rows, in the first steps
  std::vector<int> row_doubts_;            // steps in which F did not seem to keep a row
  int looks_ = 0, small_looks_ = 0;        // at doubts in rows; at a solution below its tolerances
  std::vector<double> corrected_, slope_;  // y and y' as the corrector left them
  bool repeated_ = false;                  // IDA rejected the last attempt
  bool high_index_ = false;                // F is not of index 1 in its own variables
  bool index_known_ = false;
  std::vector<int> undetermined_;  // algebraic variables of index 2 or more
  OwnedVector newton_weights_;     // without them
  int failed_corrections_ = 0;     // in a row
  bool rounding_fails_ = false;    // the corrector, by multipliers of index 2 or more
  double weights_factor_ = 1.0;    // by which IDA's weights were multiplied in the last solve()
  int refused_in_row_ = 0;         // accepted steps that needed more than one attempt
  long last_error_failures_ = 0;
  Statistics statistics_;
  double move_sum_ = 0.0;
  SampledTime timed_;

  SolverOwner<FreeEmptySolver> solver_;  // ours, the one that IDA sees
  SolverOwner<FreeSolver> own_inner_;    // where the caller gave none
  SUNNonlinearSolver inner_ = nullptr;   // decorated
  SUNNonlinSolSysFn system_ = nullptr;
  SUNNonlinSolLSolveFn linear_solve_ = nullptr;
  bool has_setup_ = false;  // IDA's linear solver has factors, or a preconditioner, to be made anew
  bool iterative_ = false;  // it is a Krylov method
  bool solver_known_ = false;
  Metric wanted_metric_;
  bool initialized_ = false;
  int maximum_iterations_ = 4;
  bool heard_ = false;  // IDASetMaxNonlinIters reached us

  std::unique_ptr<Mover> mover_;
  std::unique_ptr<Mover> own_mover_;  // for the caller's rows alone, where others are joined
  Constraints joined_;                // the caller's rows and equations of F
  OwnedVector moved_id_;              // id, with 1 where an algebraic variable moves with the rest
  Candidate present_{};               // of the present solve()
  void* mem_ = nullptr;               // and IDA's memory in it
  int stop_flag_ = 0;                 // < 0: a callback ended the run in an evaluation of our own
  std::string stop_text_;
  bool broken_ = false;   // an exception left things half done: the run cannot go on
  OwnedVector none_, f_;  // ycor = 0 and F for residual_at()
  bool contiguous_ = false;
  int size_ = 0;
  OwnedVector id_, delta_, newton_, saved_, weights_;
  double *delta_entries_ = nullptr, *newton_entries_ = nullptr, *saved_entries_ = nullptr;
  std::vector<int> algebraic_;  // indices, contiguous vectors
  bool has_algebraic_ = false;
  bool corrector_was_right_ = true;  // the polish found what IDA's convergence test promised
  // What capped moves lacked, in tolerances: in the last accepted step and in the present attempt.
  double left_before_ = 0.0, left_ = 0.0;
  std::string capped_message_;
  bool engaged_ = false;  // the policy acts from the first move that was needed
  bool probing_ = false, probed_ = false;
  std::unique_ptr<GaussNewton> point_;  // for points between steps and initial values
  std::unique_ptr<Mover> point_mover_;  // the same for gradients and user projections
  Options point_options_;
  Statistics point_statistics_;
  bool printed_ = false;

  long steps_at_attach_ = 0, steps_unseen_ = 0;
  bool said_bypass_ = false;
  IdaLifetime lifetime_;  // of ida_mem_

  long last_steps_ = -1, last_setups_ = -1;
  double cj_at_setup_ = 0.0;
  long extra_iterations_of_last_solve_ = 0;
  bool pending_ = false;  // a projected attempt that IDA has not yet judged
  Progress progress_;
  long progress_count_ = 0;
};

}  // namespace tether::ida_projection
