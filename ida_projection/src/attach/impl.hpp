// Tether: the decorator of IDA's nonlinear solver (method, eq. 5). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <sundials/sundials_nonlinearsolver.h>
#include <tether/ida_projection/projection.hpp>
#include <utility>

#include "host/corrector.hpp"
#include "host/ida.hpp"
#include "host/ida_lifetime.hpp"
#include "host/owned_vector.hpp"
#include "movers/rows_at.hpp"
#include "start/algebraic.hpp"
#include "start/consistent_start.hpp"
#include "start/joined_rows.hpp"
#include "start/point.hpp"
#include "step/attempt.hpp"
#include "step/metric_choice.hpp"
#include "step/polish.hpp"
#include "step/step_control.hpp"
#include "watch/observer.hpp"
#include "watch/report.hpp"

namespace tether::ida_projection {

/// Throws std::invalid_argument("Projection: " + text).
[[noreturn]] void reject(const std::string& text);
/// Rejects values that cannot work, naming the option, its value and the allowed ones.
void validate(const Constraints& constraints, const Options& options, N_Vector like);

/// The parts of a Projection, unless it was moved from.
template <class Pointer>
auto& own(const Pointer& impl) {
  return owned("Projection", impl);
}

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

  // projection.cpp: calls of the host
  ConsistencyReport make_consistent(double t0, N_Vector yy, N_Vector yp, const Consistency& how);
  ConsistencyReport project(double t, N_Vector yy, N_Vector yp);
  int solve_and_project(double tout, double* tret, N_Vector yret, N_Vector ypret, int itask);
  Status status();
  const std::string& message();  ///< unchanged by status() and statistics()
  Statistics statistics();
  void reset_statistics() { observer_.reset_statistics(); }

  // sensitivity/attach.cpp: a program that asks for none links none of it
  void project_sensitivities(Sensitivities given);
  ConsistencyReport make_sensitivities_consistent(double t0, N_Vector yy, N_Vector yp, N_Vector* s,
                                                  N_Vector* sp);
  ConsistencyReport project_gradient(double t, N_Vector yy, N_Vector v);

  // projected_step.cpp: the operations of SUNNonlinearSolver that IDA calls
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
  struct Moved : Move {
    Fix fix = Fix::none;  ///< of the polish beside the move
  };

  void attach();
  bool engaged() const { return run_.phase == Phase::engaged; }
  bool bypassed() { return observer_.bypassed(history_.steps(), run_.phase != Phase::late); }
  void current_weights(N_Vector y);

  void note_vectors(N_Vector y_predicted, N_Vector ycor, N_Vector weights);
  int answer(Candidate candidate);
  int step(const Attempt& attempt, double tolerance, bool call_setup);
  int begin_moves(const Attempt& attempt, bool* needed);
  void begin_run(const Candidate& candidate);
  bool in_trouble(const Attempt& attempt, const Candidate& candidate);
  int corrector_failed(const Candidate& candidate, int flag);
  bool begin_attempt(const Attempt& attempt, const Candidate& candidate);
  void find_linear_solver_kind(long steps);
  Status engage(const Candidate& candidate);
  void leave_out_of_error_test(bool coupled);
  Moved move_and_polish(const Candidate& candidate, double tolerance, bool fresh);
  bool polishes_first() const;
  bool may_change_metric() const;
  void judge_capped(Move& move);
  int hand_over(const Attempt& attempt, const Candidate& candidate, double moved);
  int finish(Status outcome, const std::string& text);

  // The caller's rows alone (null: there are none), and joined with equations of F.
  struct Rows {
    JoinedRows joined;
    std::unique_ptr<RowsAt> own;
    RowsAt* used = nullptr;
  };
  // Vectors of the host's problem.
  struct Unknowns {
    bool contiguous = false;
    int count = 0;
    OwnedVector weights;  // for points between steps and initial values
  };
  enum class Phase {
    late,      // IDA has not initialised the plugin
    watching,  // no move was needed yet: the run is that of IDA, bit for bit
    engaged,   // the policy acts
    broken     // an exception left things half done: the run cannot go on
  };
  struct Run {
    Phase phase = Phase::late;
    bool other_metric = false;      // there is one that may be used
    bool suppressed = false;        // IDASetId and IDASetSuppressAlg are this plugin's
    std::optional<bool> iterative;  // IDA's linear solver, once it is known
    long setups = -1;               // IDA's count at the last attempt
    // Lengths in tolerances: of the last move that was found, the last accepted one, and the one
    // that IDA has to judge (infinity: there was none).
    double last_move = 0.0, accepted_move = infinite, handed_move = infinite;
    double left_before = infinite, left = 0.0;  // that capped moves lacked: accepted, and now
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
  Rows rows_;
  PointProjection point_;
  ConsistentStart start_;
  Observer observer_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFreeEmpty> solver_;  // IDA sees it
  std::unique_ptr<Companion> sensitivities_;
  std::unique_ptr<RowsAt> gradient_;  // of project_gradient()
  Unknowns unknowns_;
  Candidate present_;  // of this attempt
  Metric wanted_metric_;
  MetricChoice metric_choice_;
  History history_;
  Run run_;
  Busy busy_ = Busy::no;
};

}  // namespace tether::ida_projection
