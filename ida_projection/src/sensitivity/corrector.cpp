// Tether: the decorator of IDAS' staggered corrector. SPDX-License-Identifier: BSD-3-Clause
#include "sensitivity/corrector.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <utility>

#include "host/operations.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"

// As in <idas/idas.h>, which repeats typedefs of <ida/ida.h>. Programs with IDA lack them.
extern "C" {
#pragma weak IDASetNonlinearSolverSensStg
#pragma weak IDAGetNonlinearSystemDataSens
#pragma weak IDAGetSensNumLinSolvSetups
int IDASetNonlinearSolverSensStg(void* ida_mem, SUNNonlinearSolver solver);
int IDAGetNonlinearSystemDataSens(void* ida_mem, sunrealtype* t, N_Vector** s_predicted,
                                  N_Vector** sp_predicted, N_Vector** s, N_Vector** sp,
                                  sunrealtype* cj, void** user_data);
int IDAGetSensNumLinSolvSetups(void* ida_mem, long* setups);
}

namespace tether::ida_projection {

namespace {

/// The content of an N_VectorSensWrapper, the Ns vectors that IDAS corrects together. SUNDIALS
/// declares it in sundials_nvector_senswrapper.h, which Debian does not ship; it is the same from
/// 5.8 to 7.5. See why_not_wrapped().
struct WrappedVectors {
  N_Vector* vectors;
  int count;
#if SUNDIALS_VERSION_MAJOR >= 7
  sunbooleantype owns;
#else
  booleantype owns;
#endif
};

N_Vector* vectors_of(N_Vector wrapper) {
  return static_cast<WrappedVectors*>(wrapper->content)->vectors;
}

/// Empty, or why `wrapper` is not what IDAS' prediction of `count` sensitivities looks like.
/// `expected`: its vectors, from IDAS' own getter.
std::string why_not_wrapped(N_Vector wrapper, N_Vector* expected, int count) {
  const auto* content = static_cast<const WrappedVectors*>(wrapper->content);
  if (content == nullptr || expected == nullptr) return "IDAS has no sensitivities";
  // A type of its own in the newest versions, custom in others; never one of whole vectors.
  if (wrapper->ops->nvgetarraypointer != nullptr) {
    // The table of operations of the vectors inside is copied in part only: without data access.
    return "this SUNDIALS stores sensitivities in another way than versions 5.8 to 7.5";
  }
  if (content->count != count)
    return "Sensitivities::count = " + std::to_string(count) + ", but IDASensInit was given " +
           std::to_string(content->count);
  for (int k = 0; k < count; ++k)
    if (content->vectors == nullptr || content->vectors[k] != expected[k])
      return "this SUNDIALS stores sensitivities in another way than versions 5.8 to 7.5";
  return "";
}

[[noreturn]] void refuse(const std::string& text) {
  throw std::invalid_argument("project_sensitivities: " + text);
}

void check(const Sensitivities& given, const Constraints& constraints) {
  const auto count = static_cast<std::size_t>(given.count);
  if (given.count < 1)
    refuse("Sensitivities::count = " + std::to_string(given.count) +
           ", must be the number of sensitivities given to IDASensInit");
  if (std::holds_alternative<UserProjection>(constraints.jacobian))
    refuse("a UserProjection tells no C, so sensitivities cannot be projected; give the rows");
  if (std::holds_alternative<DistributedRows>(constraints.jacobian))
    refuse("sensitivities are not projected onto DistributedRows");
  const bool gradients = std::holds_alternative<Gradients>(constraints.jacobian);
  if (gradients && given.derivative)
    refuse("rows that are Gradients need Sensitivities::vector_derivative, not derivative");
  if (!gradients && given.vector_derivative)
    refuse("Sensitivities::vector_derivative is for rows that are Gradients; give derivative");
  const bool function = given.derivative || given.vector_derivative;
  if (given.parameters == nullptr && !function && !(given.scales.empty() && given.list.empty()))
    refuse("Sensitivities::scales and list belong to parameters, which is null");
  const auto whole = [&](std::size_t size, const char* name) {
    if (size != 0 && size != count)
      refuse("Sensitivities::" + std::string(name) + " has " + std::to_string(size) +
             " entries for " + std::to_string(count) + " sensitivities");
  };
  whole(given.scales.size(), "scales");
  whole(given.list.size(), "list");
  for (const double scale : given.scales)
    if (!(std::abs(scale) > 0.0) || !std::isfinite(scale))
      refuse("Sensitivities::scales has an entry " + shortest(scale) +
             ", all must be finite and not 0");
  for (const int index : given.list)
    if (index < 0) refuse("Sensitivities::list has an entry " + std::to_string(index) + " < 0");
}

}  // namespace

SensitivityCorrector::SensitivityCorrector(Projection::Impl& state, Sensitivities given)
    : state_(state), given_(std::move(given)) {
  check(given_, state_.constraints_);
  if (&IDASetNonlinearSolverSensStg == nullptr)
    refuse("this program has IDA; link IDAS in its place, which has sensitivities");
  N_Vector like = state_.unknowns_.weights;
  SUNNonlinearSolver inner = given_.nonlinear_solver;
  if (inner == nullptr) {
    own_.reset(SUNNonlinSol_NewtonSens(count(), like, like->sunctx));
    inner = own_.get();
    if (inner == nullptr) throw std::bad_alloc();
  }
  corrector_ = std::make_unique<Corrector>(inner, like);
  for (OwnedVector* each : {&weights_, &s_, &work_, &spare_}) *each = OwnedVector(like);
  for (int k = 0; k < count(); ++k) ds_.emplace_back(like);
  for (int k = 0; k < count(); ++k) metrics_.emplace_back(state_.options_, like);
  solver_.reset(Operations<SensitivityCorrector>::make(*this, inner, like->sunctx));
  if (!solver_) throw std::bad_alloc();
  const int flag = IDASetNonlinearSolverSensStg(state_.ida_.mem(), solver_.get());
  if (flag != 0)
    refuse("IDASetNonlinearSolverSensStg returned " + std::to_string(flag) +
           "; call IDASensInit with IDA_STAGGERED before. IDA_SIMULTANEOUS corrects states and "
           "sensitivities together, past the projection of the state, and IDAS has no "
           "STAGGERED1");
}

SensitivityCorrector::~SensitivityCorrector() {
  Operations<SensitivityCorrector>::end(solver_.get(), state_.options_.print);
  state_.lifetime_.free_at_end(solver_.release());
}

void SensitivityCorrector::forget_run() {
  engaged_ = false;
  moved_ = nullptr;
  setups_ = 0;
  steps_ = saved_steps_ = -1;
  for (VectorMetric& metric : metrics_) {
    metric.reset();
    metric.free_all();
  }
}

// Whether an attempt was accepted shows in IDA's count of steps at the next one.
void SensitivityCorrector::accept() {
  const long steps = state_.ida_.steps();
  if (steps == steps_ + 1)
    for (VectorMetric& metric : metrics_) metric.accept();
  steps_ = steps;
}

// Empty, or why IDAS' vectors cannot be used.
std::string SensitivityCorrector::set_up(N_Vector predicted) {
  if (polish_) return "";
  sunrealtype t, cj;
  N_Vector *s = nullptr, *sp, *sn, *spn;
  void* data;
  IDAGetNonlinearSystemDataSens(state_.ida_.mem(), &t, &s, &sp, &sn, &spn, &cj, &data);
  const std::string reason = why_not_wrapped(predicted, s, count());
  if (!reason.empty()) return reason;
  variables_ = std::make_unique<AlgebraicVariables>(uncounted_);
  polish_ = std::make_unique<Polish>(state_.options_, uncounted_, *corrector_, *variables_);
  polish_->allocate(predicted);
  return "";
}

int SensitivityCorrector::finish(Status status) {
  // The state's outcome stands unless this one is worse.
  if (status == Status::success) return 0;
  return state_.report_.finish(status, text(), state_.ida_.steps());
}

int SensitivityCorrector::solve(N_Vector predicted, N_Vector correction, N_Vector weights,
                                double tolerance, bool call_setup, void* mem) {
  message_ = set_up(predicted);
  if (!message_.empty()) return finish(Status::internal_error);
  restore_weights(weights);
  polish_->begin();
  corrector_->begin(mem);
  const Candidate candidate{0.0, predicted, correction, weights};
  int flag = corrector_->correct(candidate, tolerance, call_setup);
  const StepData step = state_.ida_.step();
  note_setups(step.cj);
  if (flag != 0) return flag;

  use_rows_of_state();
  rows_->report.fatal = false;
  accept();
  Status status = evaluate(step);
  Fix fix = Fix::none;
  if (status == Status::success) status = move_and_polish(candidate, step, tolerance, fix);
  if (status == Status::success && fix == Fix::misled && !call_setup && corrector_->has_setup()) {
    // As for the state: a stale Jacobian fooled IDAS' convergence test.
    N_VConst(0.0, correction);
    flag = corrector_->correct(candidate, tolerance, true);
    note_setups(step.cj);
    if (flag != 0) return flag;
    status = move_and_polish(candidate, step, tolerance, fix);
  }
  if (corrector_->stopped()) return corrector_->stop_flag();
  flag = finish(status);
  if (flag == 0) leave_out_of_error_test(weights);
  return flag;
}

// Leaves out derivatives of coupled algebraic variables, for which the state has a wider tolerance.
void SensitivityCorrector::leave_out_of_error_test(N_Vector weights) {
  saved_steps_ = state_.ida_.steps();
  saved_weights_.clear();
  for (int k = 0; k < count(); ++k)
    for (const int j : state_.variables_.coupled())
      saved_weights_.push_back(std::exchange(N_VGetArrayPointer(vectors_of(weights)[k])[j], 0.0));
}

// IDAS computes them anew for a new step only.
void SensitivityCorrector::restore_weights(N_Vector weights) {
  std::size_t i = 0;
  const bool same = state_.ida_.steps() == saved_steps_;
  for (int k = 0; same && k < count(); ++k)
    for (const int j : state_.variables_.coupled())
      if (i < saved_weights_.size())
        N_VGetArrayPointer(vectors_of(weights)[k])[j] = saved_weights_[i++];
}

// The rows, the variables and the metric that move the state.
void SensitivityCorrector::use_rows_of_state() {
  const Constraints* rows = state_.rows_.joined.rows() != nullptr
                                ? &state_.rows_.joined.constraints()
                                : &state_.constraints_;
  if (moved_ != rows || !rows_) {
    moved_ = rows;
    rows_ = make_rows(*rows, state_.options_, state_.statistics_, s_);
    const auto m = static_cast<std::size_t>(rows_->count());
    r_.assign(m, 0.0);
    row_terms_.assign(static_cast<std::size_t>(count()), r_);
  }
  if (!variables_->any() && state_.variables_.any()) {
    id_ = OwnedVector(polish_->delta());
    for (int k = 0; k < count(); ++k) N_VScale(1.0, state_.variables_.id(), vectors_of(id_)[k]);
    variables_->set(id_);
  }
}

// IDAS may make new factors for sensitivities, too; both iterations divide by what they belong to.
void SensitivityCorrector::note_setups(double cj) {
  long setups = 0;
  IDAGetSensNumLinSolvSetups(state_.ida_.mem(), &setups);
  if (setups != setups_) state_.polish_.note_setup(cj);
  setups_ = setups;
  polish_->follow(state_.polish_);
}

// C at the accepted candidate.
Status SensitivityCorrector::evaluate(const StepData& step) {
  y_ = step.y;
  IDAGetErrWeights(state_.ida_.mem(), weights_);
  N_Vector id = state_.engaged() ? state_.rows_.joined.moved_id() : nullptr;
  return rows_->linearise(step.t, y_, weights_, id, state_.rows_.joined.repeats());
}

// In the metric of sensitivity k; `first`: its correction is that of IDAS.
Status SensitivityCorrector::factor(const Candidate& candidate, int k, bool first) {
  VectorMetric& metric = metrics_[static_cast<std::size_t>(k)];
  if (first) {
    const Candidate own{candidate.t, vectors_of(candidate.base)[k],
                        vectors_of(candidate.correction)[k], vectors_of(candidate.weights)[k]};
    metric.update_scale(own, work_, spare_);
    metric.set(own, spare_);
  }
  return rows_->factor_in(metric.D());
}

// Equations of F among the rows are solved by Newton's iteration already: r_ = 0 for them.
void SensitivityCorrector::add_terms(int k) {
  const std::vector<double>& terms = row_terms_[static_cast<std::size_t>(k)];
  const auto own = static_cast<std::size_t>(state_.constraints_.total_count());
  for (std::size_t i = 0; i < r_.size(); ++i) r_[i] = i < own ? r_[i] + terms[i] : 0.0;
}

// ds_k for the candidate; `longest`: in tolerances of s_k. The second move has the rows of the
// first.
Status SensitivityCorrector::find_moves(const Candidate& candidate, double t, bool first,
                                        double* longest) {
  *longest = 0.0;
  for (int k = 0; k < count(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    N_VLinearSum(1.0, vectors_of(candidate.base)[k], 1.0, vectors_of(candidate.correction)[k], s_);
    if (first) {
      const Status known = derivative(k, t, y_);
      if (known != Status::success) return known;
    }
    Status status = factor(candidate, k, first);
    if (status == Status::success) status = rows_->product(s_, r_);
    if (status != Status::success) return status;
    add_terms(k);
    rows_->solve_for(r_, ds_[i]);
    const double length = N_VWrmsNorm(ds_[i], vectors_of(candidate.weights)[k]);
    if (!std::isfinite(length)) {
      message_ = "the move of sensitivity " + std::to_string(k) + " is not finite";
      return Status::not_finite;
    }
    *longest = std::max(*longest, length);
  }
  return Status::success;
}

// As for the state. Sensitivities that take no part in IDAS' error test change by any length.
Status SensitivityCorrector::too_long(const Candidate& candidate, int k, double length) {
  const double change =
      N_VWrmsNorm(vectors_of(candidate.correction)[k], vectors_of(candidate.weights)[k]);
  const double limit = state_.options_.advanced.largest_move * std::max(1.0, change);
  if (length <= limit) return Status::success;
  message_ = "the move of sensitivity " + std::to_string(k) + " onto C s + dg/dp = 0 is " +
             brief(length) + " tolerances long, the limit is " + brief(limit) +
             " (Advanced::largest_move); start with make_sensitivities_consistent, and check dg/dp";
  return Status::move_too_long;
}

void SensitivityCorrector::apply(const Candidate& candidate) {
  for (int k = 0; k < count(); ++k) {
    N_Vector e = vectors_of(candidate.correction)[k];
    N_VLinearSum(1.0, e, -1.0, ds_[static_cast<std::size_t>(k)], e);
  }
}

Status SensitivityCorrector::move_and_polish(const Candidate& candidate, const StepData& step,
                                             double tolerance, Fix& fix) {
  double length = 0.0;
  Status status = find_moves(candidate, step.t, true, &length);
  if (moved_ != &state_.constraints_) state_.rows_.joined.restore_ida();
  if (status != Status::success) return status;
  if (!engaged_) {
    const double floor = 4.0 * kEpsilon * N_VWrmsNorm(candidate.base, candidate.weights);
    if (length <= std::max(kNothing, floor)) return Status::success;
    engaged_ = true;
  }
  if (length > state_.options_.advanced.largest_move)
    for (int k = 0; k < count(); ++k) {
      N_Vector w = vectors_of(candidate.weights)[k];
      status = too_long(candidate, k, N_VWrmsNorm(ds_[static_cast<std::size_t>(k)], w));
      if (status != Status::success) return status;
    }
  polish_->keep(candidate);
  apply(candidate);
  ++state_.statistics_.sensitivity_projections;
  if (!polish_->wanted(length, false)) return Status::success;
  fix = polish_->add_newton_step(candidate, step.cj, tolerance, true);
  if (fix == Fix::none) return Status::success;
  status = find_moves(candidate, step.t, false, &length);
  if (status == Status::success) apply(candidate);
  return status;
}

}  // namespace tether::ida_projection
