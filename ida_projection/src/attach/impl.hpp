// Tether: the decorator of IDA's nonlinear solver (method, eq. 5). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <sundials/sundials_nonlinearsolver.h>
#include <tether/ida_projection/projection.hpp>
#include <utility>

#include "host/corrector.hpp"
#include "host/ida.hpp"
#include "host/ida_lifetime.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "start/algebraic.hpp"
#include "start/joined_rows.hpp"
#include "start/point.hpp"
#include "step/metric_choice.hpp"
#include "step/polish.hpp"
#include "step/step_control.hpp"
#include "watch/bypass.hpp"
#include "watch/first_steps.hpp"
#include "watch/rejections.hpp"
#include "watch/report.hpp"

namespace tether::ida_projection {

/// Throws std::invalid_argument("Projection: " + text).
[[noreturn]] void reject(const std::string& text);
/// Rejects values that cannot work, naming the option, its value and the allowed ones.
void validate(const Constraints& constraints, const Options& options, N_Vector like);

constexpr double infinite = std::numeric_limits<double>::infinity();

/// State of an add-on, which is told when a new run begins.
class Companion {
 public:
  virtual ~Companion() = default;
  virtual void forget_run() {}
};

/// The decorator of IDA's nonlinear solver: puts the parts of a projected step together.
class Projection::Impl {
  friend class SensitivityCorrector;  // an add-on, which moves sensitivities as the state

 public:
  Impl(void* ida_mem, Constraints constraints, Options options);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // consistency.cpp
  ConsistencyReport make_consistent(double t0, N_Vector yy, N_Vector yp, const Consistency& how);
  ConsistencyReport project(double t, N_Vector yy, N_Vector yp);
  int solve_and_project(double tout, double* tret, N_Vector yret, N_Vector ypret, int itask);

  // sensitivity/attach.cpp: a program that asks for none links none of it
  void project_sensitivities(Sensitivities given, const tether_idas_functions& idas);
  ConsistencyReport make_sensitivities_consistent(double t0, N_Vector yy, N_Vector yp, N_Vector* s,
                                                  N_Vector* sp);
  ConsistencyReport project_gradient(double t, N_Vector yy, N_Vector v);

  const Constraints& constraints() const { return constraints_; }
  Status status();
  const std::string& message();  ///< unchanged by status() and statistics()
  Statistics statistics();
  void reset_statistics();

  // The operations of SUNNonlinearSolver that IDA calls (decorator.cpp).
  int initialize();
  int solve(N_Vector y_predicted, N_Vector ycor, N_Vector weights, double tolerance,
            bool call_setup, void* mem);
  Corrector& corrector() { return corrector_; }
  long iterations_after_correction() const { return polish_.iterations(); }
  /// Keeps an exception as status and message; returns the code for IDA. No exception may pass
  /// through IDA's C functions.
  int caught(Status outcome, const char* text) noexcept;

  /// Runs a call of the host, or refuses it with a report where it cannot be served.
  template <class Call>
  ConsistencyReport report_of(const char* function, std::initializer_list<N_Vector> vectors,
                              Call call) {
    ConsistencyReport report;
    report.message = why_misused(function, vectors);
    report.status = Status::misused;
    if (report.message.empty()) {
      const InUse here(*this, Busy::call);
      report = call();
    }
    report_.status = report.status;
    report_.message = report.message;
    return report;
  }
  std::string why_misused(const char* function, std::initializer_list<N_Vector> vectors) const;
  std::string why_unlike_y(N_Vector v) const;

 private:
  // Under way: nothing, a call of the host, or a step of IDA.
  enum class Busy { no, call, step };
  class InUse {
   public:
    InUse(Impl& owner, Busy busy) : owner_(owner), before_(std::exchange(owner.busy_, busy)) {}
    ~InUse() { owner_.busy_ = before_; }
    InUse(const InUse&) = delete;
    InUse& operator=(const InUse&) = delete;

   private:
    Impl& owner_;
    Busy before_;
  };
  // The attempt that IDA has not yet judged, and the last step.
  struct Attempts {
    long steps = -1, setups = -1;     // IDA's counts at the last attempt
    bool repeated = false;            // IDA rejected it
    double moved = infinite;          // tolerances; infinity: no point was found
    double last_move = 0.0;           // that was found, in tolerances
    double accepted_move = infinite;  // of the last accepted step
    Progress progress;                // what the caller is told once it is accepted
    // Lengths that capped moves lacked, in tolerances: in the last accepted step, and in this
    // attempt.
    double left_before = infinite, left = 0.0;
    double first_move = 0.0;  // of the last attempt at the first step, in tolerances
    int refused_starts = 0;   // attempts at it with a move that does not shrink
  };

  void attach();
  void check_for_bypass() { watch_.bypass.check(attempts_.steps, run_.initialized, report_); }

  // decorator.cpp: the stages of a projected step
  int step(Candidate& candidate, double tolerance, bool call_setup);
  void choose_step(const Candidate& candidate);
  int correct(const Candidate& candidate, double tolerance, bool call_setup);
  void begin_move(Candidate& candidate, const StepData& step);
  void account_for_previous_attempt(const StepData& step);
  struct Moved : Move {
    bool corrector_was_right = true;  ///< the polish confirmed its convergence test
  };
  Moved move_and_polish(const Candidate& candidate, double cj, double tolerance, bool fresh);
  void judge_capped(Move& move);
  bool wants_polish(double length) const { return polish_.wanted(length, control_.smoothing()); }
  bool polishes_first();
  bool may_change_metric() const;
  void account(const Move& move, const StepData& step);
  int finish(Status outcome, const std::string& text);

  // engage.cpp
  void find_linear_solver_kind();
  bool rows_of_field() const;
  void derive_id(const Candidate& candidate);
  void leave_out_of_error_test(bool coupled);  ///< `coupled`: variables of index 1 stay in it
  void test_all_again();
  std::optional<int> engage_in_trouble(const Candidate& candidate);
  SetpointFactors setpoint_of_high_index(const Candidate& candidate) const;
  void begin_run(const Candidate& candidate);
  void quicken_vectors(const Candidate& candidate);
  std::optional<int> measure_before_engaging(const Candidate& candidate);
  Status engage(const Candidate& candidate);

  // doubts.cpp
  void check_start(const Move& move);
  void check_rows(const Candidate& candidate, const StepData& step);
  void keep_point_before(const Candidate& candidate, OwnedVector& y);
  std::string undetermined_at(const Candidate& candidate, N_Vector y);
  std::string too_high_index() const;
  std::string rounding_of_multipliers() const;
  std::optional<int> watch_rejections(const Candidate& candidate, const StepData& step);
  int corrector_failed(const Candidate& candidate, int flag);

  // choose_metric.cpp
  void choose_metric(const Candidate& candidate, Move& move);
  Move move_by_levels(const Candidate& candidate, bool by_levels);
  MoveAndResponse try_other_metric(const Candidate& candidate, const MoveAndResponse& present,
                                   Move& move);

  // consistency.cpp
  struct Inquiry;
  void probe(double t0, N_Vector yy, N_Vector yp, Inquiry& inquiry);
  int answer_inquiry(Candidate& candidate);
  void find_derivative(double t0, N_Vector y, N_Vector ydot, const Consistency& how);
  ConsistencyReport project_start(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                                  bool* jointly);
  std::optional<ConsistencyReport> move_algebraic_first(double t0, N_Vector start, N_Vector y,
                                                        N_Vector ydot, const Consistency& how);
  void settle_start(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                    ConsistencyReport& report);
  void note_changes(ConsistencyReport& report, N_Vector yy, N_Vector y, N_Vector yp,
                    N_Vector ydot) const;
  void current_weights(N_Vector y);

  // Movers of the caller's rows alone (null: there are none), and joined with equations of F.
  struct Movers {
    JoinedRows joined;
    std::unique_ptr<Mover> own;
    Mover* used = nullptr;
  };
  // Vectors of the host's problem.
  struct Unknowns {
    bool contiguous = false;
    int count = 0;
    OwnedVector weights;  // for points between steps and initial values
  };
  struct Watches {
    RowFaults faults;
    RejectionWatch rejections;
    FirstSteps first_steps;
    BypassWatch bypass;
  };
  struct Run {
    bool initialized = false;
    bool broken = false;            // an exception left things half done: the run cannot go on
    bool suppressed = false;        // IDASetId and IDASetSuppressAlg are this plugin's
    bool engaged = false;           // the policy acts from the first move that was needed
    std::optional<bool> iterative;  // IDA's linear solver, once it is known
    OwnedVector start;              // its first y, of contiguous vectors
    std::string undetermined;       // multipliers at the start, or where correctors fail
  };
  // Statistics of the moves.
  struct Tally {
    double move_sum = 0.0;
    long attempts = 0;  // since moves began
  };

  Constraints constraints_;
  Options options_;
  Statistics statistics_;
  Ida ida_;
  IdaLifetime lifetime_;
  Report report_;
  Corrector corrector_;
  AlgebraicVariables variables_;
  Polish polish_;
  StepControl control_;
  Movers movers_;
  PointProjection point_;
  Watches watch_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFreeEmpty> solver_;  // IDA sees it
  std::unique_ptr<Companion> sensitivities_;
  std::unique_ptr<RowsAt> gradient_;  // of project_gradient()
  Unknowns unknowns_;
  Metric wanted_metric_;
  MetricChoice metric_choice_;
  Run run_;
  Inquiry* inquiry_ = nullptr;  // only while make_consistent() probes a start
  Busy busy_ = Busy::no;
  Attempts attempts_;
  Tally tally_;
};

}  // namespace tether::ida_projection
