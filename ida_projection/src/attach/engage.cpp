// Tether: how moves begin in a run. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <utility>

#include "attach/impl.hpp"
#include "fast/kernels.hpp"
#include "host/mechanisms.hpp"
#include "host/rounding.hpp"

namespace tether::ida_projection {

namespace {

// Setpoint for multipliers of index 2 (method, section 7), see setpoint_of_high_index().
constexpr double kAsideFromTest = 1.5, kAtLowOrders = 0.9, kProportional = 1e-4, kManyFree = 0.4;
constexpr int kFew = 16;  // unknowns per row from which on rows are few

}  // namespace

// Whether the rows are a few invariants of many unknowns, as of a field on a grid. Rows of
// mechanisms are many and local.
bool Projection::Impl::rows_of_field() const {
  if (std::holds_alternative<DistributedRows>(constraints_.jacobian)) return false;
  const bool gradients = std::holds_alternative<Gradients>(constraints_.jacobian);
  return gradients || kFew * constraints_.total_count() <= N_VGetLength(unknowns_.weights);
}

// No getter tells the type of IDA's linear solver. Only iterative solvers count iterations, from
// the first nonzero right-hand side on.
void Projection::Impl::find_linear_solver_kind() {
  long iterations = 0, preconditioners = 0, jacobians = 0;
  IDAGetNumLinIters(ida_.mem(), &iterations);
  IDAGetNumPrecEvals(ida_.mem(), &preconditioners);
  IDAGetNumJacEvals(ida_.mem(), &jacobians);
  const bool iterative = iterations > 0 || preconditioners > 0;
  if (iterative || (jacobians > 0 && attempts_.steps > 0)) run_.iterative = iterative;
  if (wanted_metric_ == Metric::automatic)
    options_.advanced.metric =
        iterative && rows_of_field() ? Metric::error_weights : Metric::local_correction;
  polish_.note_linear_solver(iterative);
}

// Derives the id vector from F. What is wrong with it is readable through message().
void Projection::Impl::derive_id(const Candidate& candidate) {
  const std::string unknown = variables_.derive(candidate, corrector_, ida_.step().cj);
  if (!unknown.empty())
    report_.advice = "algebraic variables were not derived (" + unknown +
                     ") and stay in the error test; give IDA's id vector in Options::id";
}

void Projection::Impl::leave_out_of_error_test(bool coupled) {
  if (!options_.suppress_algebraic || !variables_.choose_tested(coupled)) return;
  const N_Vector tested = variables_.tested();
  IDASetId(ida_.mem(), tested);
  IDASetSuppressAlg(ida_.mem(), 1);
  control_.test_algebraic(variables_.coupled());
  run_.suppressed = true;
  statistics_.untested =
      std::lround(static_cast<double>(N_VGetLength(tested)) - N_VDotProd(tested, tested));
}

// Puts algebraic variables back into IDA's error test. Where the caller gives Options::id he may
// have called IDASetSuppressAlg as well, which no getter tells, so that nothing is changed.
void Projection::Impl::test_all_again() {
  if (std::exchange(run_.suppressed, false) && options_.id == nullptr) {
    IDASetSuppressAlg(ida_.mem(), 0);
    IDASetId(ida_.mem(), variables_.vector());
  }
}

// Begins the policy when steps fail. Multipliers of index 2 fail the error test at every step size.
// Steps would shrink until rounding, divided by the step, makes the corrector fail.
std::optional<int> Projection::Impl::engage_in_trouble(const Candidate& candidate) {
  if (movers_.used == nullptr) return {};
  if (attempts_.steps < 0) begin_run(candidate);
  const bool may_be_high = !variables_.index_known() || variables_.high_index();
  if (run_.engaged || !may_be_high || !in_use(Mechanism::index_in_trouble) ||
      !control_.in_trouble(attempts_.steps))
    return {};
  if (!variables_.known()) derive_id(candidate);
  variables_.find_index(candidate, corrector_, ida_.step().cj, ida_.evaluations_for_jacobian());
  if (!variables_.high_index() || !variables_.any()) return {};
  const Status engaged = engage(candidate);
  if (engaged == Status::success) return {};
  return finish(engaged, movers_.used->message());
}

// Prepares a run before its first attempt.
void Projection::Impl::begin_run(const Candidate& candidate) {
  quicken_vectors(candidate);
  if (unknowns_.contiguous) keep_point_before(candidate, run_.start);
}

// The factor s by which errors are kept below the tolerance. End errors follow
// (tolerance / s)^(k/(k+1)) at order k, so that s in proportion to tolerance^(-1/k), with k = 5,
// makes them follow the tolerance. Where rows leave few directions free the projection removes most
// of the error, and s keeps its usual value. Runs at loose tolerances are short and of low order,
// where s is halved.
SetpointFactors Projection::Impl::setpoint_of_high_index(const Candidate& candidate) const {
  const N_Vector id = variables_.id();
  const SetpointFactors usual{kAsideFromTest, kAsideFromTest};
  if (!in_use(Mechanism::stricter_setpoint) || variables_.undetermined().empty()) return usual;
  const double differential = N_VDotProd(id, id);
  if (constraints_.total_count() > (1.0 - kManyFree) * differential) return usual;
  const double unknowns = N_VWrmsNormMask(candidate.base, candidate.weights, id);  // in tolerances
  const double tighter = std::max(1.0, std::pow(kProportional * unknowns, 0.2));
  return {kAsideFromTest * tighter, kAtLowOrders * tighter * tighter};
}

// Gives fast kernels to IDA's vectors that pass through here and to the plugin's own. Vectors of
// the caller stay as they are.
void Projection::Impl::quicken_vectors(const Candidate& candidate) {
  N_Vector newton = nullptr;
  if (options_.nonlinear_solver == nullptr)
    newton = static_cast<SUNNonlinearSolverContent_Newton>(corrector_.inner()->content)->delta;
  const StepData step = ida_.step();
  fast::quicken({candidate.correction, step.residual}, false);
  polish_.quicken();
  fast::quicken({step.y_predicted, step.yp_predicted, candidate.weights, newton}, true);
}

// Returns the code for IDA if this attempt needs no move: until a first move is needed, the run is
// that of IDA bit for bit.
std::optional<int> Projection::Impl::measure_before_engaging(const Candidate& candidate) {
  const Move first = movers_.used->measure(candidate);
  if (first.status != Status::success) {
    const int code = finish(first.status, movers_.used->message());
    // In the first step rows that contradict each other do so at every step size.
    return attempts_.steps == 0 && first.status == Status::inconsistent ? kFatal : code;
  }
  if (first.length <= std::max(kNothing, first.floor) && !control_.struggling()) {
    ++statistics_.skipped;
    statistics_.largest_drift_before =
        std::max(statistics_.largest_drift_before, first.drift_before);
    statistics_.largest_drift_after = std::max(statistics_.largest_drift_after, first.drift_before);
    return finish(Status::success, "");
  }
  return {};
}

// Switches the policy on: IDA's settings stay as they are until the first move is needed.
Status Projection::Impl::engage(const Candidate& candidate) {
  if (!variables_.known()) derive_id(candidate);
  const double cj = ida_.step().cj;
  // Multipliers of index 2 respond to a change of h by errors in proportion to that change.
  if (options_.advanced.smooth_where_needed || (options_.suppress_algebraic && variables_.any()))
    variables_.find_index(candidate, corrector_, cj, ida_.evaluations_for_jacobian());
  else
    variables_.note_index_as_low();
  leave_out_of_error_test(true);
  const bool given = options_.id != nullptr;
  const std::string doubts = given ? variables_.doubts(candidate, corrector_, cj) : std::string();
  if (!doubts.empty()) report_.warn(Status::doubtful, doubts);
  if (variables_.high_index()) {
    control_.begin_smoothing(setpoint_of_high_index(candidate));
    const std::string found = run_.start ? undetermined_at(candidate, run_.start) : std::string();
    if (!found.empty() && doubts.empty()) {
      run_.undetermined = "the motion from the start is not determined: there " + found;
      report_.warn(Status::doubtful, run_.undetermined);
    }
    const std::string index = too_high_index();
    if (!index.empty()) report_.warn(Status::doubtful, index);
  }
  if (in_use(Mechanism::joined_equations)) movers_.joined.join(candidate, cj);
  movers_.used = movers_.joined.mover() != nullptr ? movers_.joined.mover() : movers_.own.get();
  if (corrector_.stopped()) return Status::callback_fatal;
  const Status structured =
      movers_.used->rows().set_algebraic(candidate, movers_.joined.moved_id());
  run_.engaged = structured == Status::success;  // else the next attempt tries again
  return structured;
}

}  // namespace tether::ida_projection
