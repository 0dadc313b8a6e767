// Tether: sensitivities of IDAS beside the state: the decorator of IDAS' staggered corrector, and
// starts. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <tether/ida_projection/sensitivities.hpp>
#include <utility>
#include <vector>

#include "attach/impl.hpp"
#include "host/operations.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"
#include "movers/vector/vector_metric.hpp"

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
  // A type of its own in the newest versions, custom in others; never one of whole vectors. The
  // table of operations of the vectors inside is copied in part only: without data access.
  const bool wrapped = wrapper->ops->nvgetarraypointer == nullptr;
  if (wrapped && content->count != count)
    return "Sensitivities::count = " + std::to_string(count) + ", but IDASensInit was given " +
           std::to_string(content->count);
  if (wrapped && content->vectors != nullptr &&
      std::equal(expected, expected + count, content->vectors))
    return "";
  return "this SUNDIALS stores sensitivities in another way than versions 5.8 to 7.5";
}

[[noreturn]] void refuse(const std::string& text) {
  throw std::invalid_argument("project_sensitivities: " + text);
}

void check(const Sensitivities& given, const Constraints& constraints) {
  const std::string its = "Sensitivities::";
  const auto check_size = [&](std::size_t size, const char* name) {
    if (size != 0 && size != static_cast<std::size_t>(given.count))
      refuse(its + name + " has " + std::to_string(size) + " entries for " +
             std::to_string(given.count) + " sensitivities");
  };
  if (given.count < 1)
    refuse(its + "count = " + std::to_string(given.count) +
           ", must be the number of sensitivities given to IDASensInit");
  if (std::holds_alternative<UserProjection>(constraints.jacobian))
    refuse("a UserProjection tells no C, so sensitivities cannot be projected; give the rows");
  if (std::holds_alternative<DistributedRows>(constraints.jacobian))
    refuse("sensitivities are not projected onto DistributedRows");
  const bool gradients = std::holds_alternative<Gradients>(constraints.jacobian);
  if (gradients ? bool(given.derivative) : bool(given.vector_derivative))
    refuse(its + (gradients ? "derivative" : "vector_derivative") + " is for rows that are" +
           (gradients ? " not" : "") + " Gradients; give " +
           (gradients ? "vector_derivative" : "derivative"));
  const bool function = given.derivative || given.vector_derivative;
  if (given.parameters == nullptr && !function && !(given.scales.empty() && given.list.empty()))
    refuse(its + "scales and list belong to parameters, which is null");
  check_size(given.scales.size(), "scales");
  check_size(given.list.size(), "list");
  for (const double scale : given.scales)
    if (!(std::abs(scale) > 0.0) || !std::isfinite(scale))
      refuse(its + "scales has an entry " + shortest(scale) + ", all must be finite and not 0");
  for (const int index : given.list)
    if (index < 0) refuse(its + "list has an entry " + std::to_string(index) + " < 0");
}

// A parameter of the host, put back whatever happens.
struct Shifted {
  double* p;
  double value = *p;
  ~Shifted() { *p = value; }
};

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

}  // namespace

/// After IDAS has corrected the sensitivities s_k = spred_k + e_k of a step whose state is
/// projected already: e_k <- e_k - ds_k with C (s_k - ds_k) + dg/dp_k = 0, C at that state. As for
/// the state, a polish follows, and is moved back onto the rows: it removes the noise that IDAS'
/// convergence test leaves and lets algebraic variables respond. Each sensitivity has a metric of
/// its own, from the size of its corrections, which makes its errors smaller than the metric of the
/// state does.
class SensitivityCorrector final : public Companion {
 public:
  /// `state`: the half of the plugin that moves the state. Throws std::invalid_argument.
  SensitivityCorrector(Projection::Impl& state, Sensitivities given)
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
  ~SensitivityCorrector() override {
    Operations<SensitivityCorrector>::end(solver_.get(), state_.options_.print);
    state_.lifetime_.free_at_end(solver_.release());
  }
  SensitivityCorrector(const SensitivityCorrector&) = delete;
  SensitivityCorrector& operator=(const SensitivityCorrector&) = delete;

  /// A new run of the state begins.
  void forget_run() override {
    engaged_ = false;
    moved_ = nullptr;
    setups_ = 0;
    steps_ = saved_steps_ = -1;
    for (VectorMetric& metric : metrics_) {
      metric.reset();
      metric.free_all();
    }
  }
  int count() const { return given_.count; }
  /// s onto the rows r(t, y) = C s + dg/dp by its shortest change, then s' onto C s' + dr/dt along
  /// (y, y') at fixed s, that derivative by central differences of fourth order.
  void make_consistent(double t, N_Vector y, N_Vector yp, N_Vector weights, N_Vector* s,
                       N_Vector* sp, ConsistencyReport& report) {
    moved_ = nullptr;
    message_.clear();
    const Constraints& rows = state_.constraints_;
    rows_ = make_rows(rows, state_.options_, state_.statistics_, s_);
    row_terms_.assign(static_cast<std::size_t>(count()),
                      std::vector<double>(static_cast<std::size_t>(rows_->count()), 0.0));
    r_ = row_terms_.front();
    OwnedVector at(y), D(y);
    N_VInv(weights, D);
    // r_ and the factors of C at (t + e, y + e y').
    const auto residual = [&](int k, double e, N_Vector of) {
      N_VLinearSum(1.0, y, e, yp, at);
      Status status = rows_->linearise(t + e, at, weights, state_.variables_.id(), {});
      if (status == Status::success) status = rows_->factor_in(D);
      if (status == Status::success) status = derivative(k, t + e, at);
      if (status == Status::success) status = rows_->product(of, r_);
      for (std::size_t i = 0; i < r_.size(); ++i)
        r_[i] += row_terms_[static_cast<std::size_t>(k)][i];
      return status;
    };
    const double speed = N_VMaxNorm(yp), size = N_VMaxNorm(y);
    const double e =
        kWideIncrement * (speed > 0.0 && size > 0.0 ? size / speed : std::max(1.0, std::abs(t)));
    std::vector<OwnedVector> moved, moved_p;
    const auto fail = [&](Status status) {
      report.status = status;
      report.message = text();
    };
    for (int k = 0; k < count(); ++k) {
      moved.emplace_back(y);
      N_VScale(1.0, s[k], moved.back());
      Status status = residual(k, 0.0, moved.back());
      if (status != Status::success) return fail(status);
      report.drift_before = std::max(report.drift_before, largest(r_));
      rows_->solve_for(r_, work_);
      N_VLinearSum(1.0, moved.back(), -1.0, work_, moved.back());
      report.move = std::max(report.move, N_VWrmsNorm(work_, weights));
      report.largest_change = std::max(report.largest_change, N_VMaxNorm(work_));
      if ((status = residual(k, 0.0, moved.back())) != Status::success) return fail(status);
      report.drift_after = std::max(report.drift_after, largest(r_));
      if (sp == nullptr) continue;
      std::vector<double> rate(r_.size());
      status = central_differences(e, rate, r_, [&](double step, std::vector<double>&) {
        return residual(k, step, moved.back());
      });
      if (status != Status::success) return fail(status);
      if ((status = residual(k, 0.0, sp[k])) != Status::success) return fail(status);
      for (std::size_t i = 0; i < r_.size(); ++i)
        rate[i] += r_[i] - row_terms_[static_cast<std::size_t>(k)][i];
      rows_->solve_for(rate, work_);
      moved_p.emplace_back(y);
      N_VLinearSum(1.0, sp[k], -1.0, work_, moved_p.back());
      report.derivative_change = std::max(report.derivative_change, N_VMaxNorm(work_));
    }
    for (int k = 0; k < count(); ++k) {
      N_VScale(1.0, moved[static_cast<std::size_t>(k)], s[k]);
      if (sp != nullptr) N_VScale(1.0, moved_p[static_cast<std::size_t>(k)], sp[k]);
    }
    report.status = Status::success;
  }

  // IDAS calls these, see host/operations.hpp.
  int initialize() { return corrector_->initialize(); }
  int solve(N_Vector predicted, N_Vector correction, N_Vector weights, double tolerance,
            bool call_setup, void* mem) {
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
    y_ = step.y;
    IDAGetErrWeights(state_.ida_.mem(), weights_);
    N_Vector id = state_.engaged() ? state_.rows_.joined.moved_id() : nullptr;
    Status status = rows_->linearise(step.t, y_, weights_, id, state_.rows_.joined.repeats());
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
  Corrector& corrector() { return *corrector_; }
  long iterations_after_correction() const { return polish_ ? polish_->iterations() : 0; }
  int caught(Status outcome, const char* text) noexcept {
    return state_.report_.caught(outcome, text);
  }

 private:
  // Whether an attempt was accepted shows in IDA's count of steps at the next one.
  void accept() {
    const long steps = state_.ida_.steps();
    if (steps == steps_ + 1)
      for (VectorMetric& metric : metrics_) metric.accept();
    steps_ = steps;
  }
  // Empty, or why IDAS' vectors cannot be used.
  std::string set_up(N_Vector predicted) {
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
  int finish(Status status) {
    // The state's outcome stands unless this one is worse.
    if (status == Status::success) return 0;
    return state_.report_.finish(status, text(), state_.ida_.steps());
  }
  // Leaves out derivatives of coupled algebraic variables, for which the state has a wider
  // tolerance.
  void leave_out_of_error_test(N_Vector weights) {
    saved_steps_ = state_.ida_.steps();
    saved_weights_.clear();
    for (int k = 0; k < count(); ++k)
      for (const int j : state_.variables_.coupled())
        saved_weights_.push_back(std::exchange(N_VGetArrayPointer(vectors_of(weights)[k])[j], 0.0));
  }
  // IDAS computes them anew for a new step only.
  void restore_weights(N_Vector weights) {
    std::size_t i = 0;
    const bool same = state_.ida_.steps() == saved_steps_;
    for (int k = 0; same && k < count(); ++k)
      for (const int j : state_.variables_.coupled())
        if (i < saved_weights_.size())
          N_VGetArrayPointer(vectors_of(weights)[k])[j] = saved_weights_[i++];
  }
  // The rows, the variables and the metric that move the state.
  void use_rows_of_state() {
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
  // IDAS may make new factors for sensitivities, too; both iterations divide by what they belong
  // to.
  void note_setups(double cj) {
    long setups = 0;
    IDAGetSensNumLinSolvSetups(state_.ida_.mem(), &setups);
    if (setups != setups_) state_.polish_.note_setup(cj);
    setups_ = setups;
    polish_->follow(state_.polish_);
  }
  // ds_k for the candidate, each in its metric; `longest`: in tolerances of s_k. `first`: the
  // corrections are those of IDAS. The second move has the rows and metrics of the first.
  Status find_moves(const Candidate& candidate, double t, bool first, double* longest) {
    const auto own_rows = static_cast<std::size_t>(state_.constraints_.total_count());
    *longest = 0.0;
    for (int k = 0; k < count(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      const Candidate own{candidate.t, vectors_of(candidate.base)[k],
                          vectors_of(candidate.correction)[k], vectors_of(candidate.weights)[k]};
      N_VLinearSum(1.0, own.base, 1.0, own.correction, s_);
      Status status = first ? derivative(k, t, y_) : Status::success;
      if (first) {
        metrics_[i].update_scale(own, work_, spare_);
        metrics_[i].set(own, spare_);
      }
      if (status == Status::success) status = rows_->factor_in(metrics_[i].D());
      if (status == Status::success) status = rows_->product(s_, r_);
      if (status != Status::success) return status;
      // Equations of F among the rows are solved by Newton's iteration already.
      for (std::size_t j = 0; j < r_.size(); ++j)
        r_[j] = j < own_rows ? r_[j] + row_terms_[i][j] : 0.0;
      rows_->solve_for(r_, ds_[i]);
      const double length = N_VWrmsNorm(ds_[i], own.weights);
      *longest = std::max(*longest, length);
      // As for the state. Sensitivities out of IDAS' error test change by any length.
      const double limit = state_.options_.advanced.largest_move *
                           std::max(1.0, N_VWrmsNorm(own.correction, own.weights));
      if (length <= limit || (!first && std::isfinite(length))) continue;
      message_ =
          "the move of sensitivity " + std::to_string(k) + " onto C s + dg/dp = 0 is " +
          brief(length) + " tolerances long, the limit is " + brief(limit) +
          " (Advanced::largest_move); start with make_sensitivities_consistent, and check dg/dp";
      return std::isfinite(length) ? Status::move_too_long : Status::not_finite;
    }
    return Status::success;
  }
  void apply(const Candidate& candidate) {
    for (int k = 0; k < count(); ++k) {
      N_Vector e = vectors_of(candidate.correction)[k];
      N_VLinearSum(1.0, e, -1.0, ds_[static_cast<std::size_t>(k)], e);
    }
  }
  Status move_and_polish(const Candidate& candidate, const StepData& step, double tolerance,
                         Fix& fix) {
    double length = 0.0;
    Status status = find_moves(candidate, step.t, true, &length);
    if (moved_ != &state_.constraints_) state_.rows_.joined.restore_ida();
    if (status != Status::success) return status;
    if (!engaged_) {
      const double floor = 4.0 * kEpsilon * N_VWrmsNorm(candidate.base, candidate.weights);
      if (length <= std::max(kNothing, floor)) return Status::success;
      engaged_ = true;
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
  // dg/dp_k for the rows of the caller: the caller's function, extrapolated central differences of
  // g in p_k, or zero.
  Status derivative(int k, double t, N_Vector y) {
    std::vector<double>& g_p = row_terms_[static_cast<std::size_t>(k)];
    std::fill(g_p.begin(), g_p.end(), 0.0);
    const auto name = [k] { return "dg/dp of parameter " + std::to_string(k); };
    if (given_.derivative || given_.vector_derivative) {
      std::string thrown;
      const auto call = [&] {
        if (given_.vector_derivative) return given_.vector_derivative(t, y, k, g_p.data());
        return given_.derivative(t, ConstVector(N_VGetArrayPointer(y), N_VGetLength(y)), k,
                                 Vector(g_p.data(), state_.constraints_.total_count()));
      };
      const int flag = guarded(call, thrown);
      if (flag != 0) {
        RowsReport report;
        const Status status = report.failed(flag, name(), thrown, 0);
        message_ = report.text;
        return status;
      }
    } else if (given_.parameters != nullptr) {
      const Status status = differences(k, t, y, g_p);
      if (status != Status::success) return status;
    }
    if (all_finite(g_p.data(), g_p.size())) return Status::success;
    message_ = name() + " is not finite at t = " + brief(t);
    return Status::not_finite;
  }
  Status differences(int parameter, double t, N_Vector y, std::vector<double>& g_p) {
    const auto k = static_cast<std::size_t>(parameter);
    const Shifted p{given_.parameters + (given_.list.empty() ? parameter : given_.list[k])};
    const double size = std::abs(given_.scales.empty() ? p.value : given_.scales[k]);
    // A power of two: p + d - p is d.
    const double d = std::exp2(std::round(std::log2(kWideIncrement * (size > 0.0 ? size : 1.0))));
    shifted_.resize(g_p.size());
    return central_differences(d, g_p, shifted_, [&](double e, std::vector<double>& g) {
      *p.p = p.value + e;
      return rows_->value_at(t, y, g);
    });
  }
  const std::string& text() const { return message_.empty() ? rows_->report.text : message_; }

  Projection::Impl& state_;
  Sensitivities given_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFree> own_;
  std::unique_ptr<Corrector> corrector_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFreeEmpty> solver_;  // IDAS sees it

  const Constraints* moved_ = nullptr;  // the caller's rows, or joined with equations of F
  std::unique_ptr<RowsAt> rows_;
  OwnedVector weights_, s_, work_, spare_;
  N_Vector y_ = nullptr;                        // the accepted candidate
  std::vector<VectorMetric> metrics_;           // of each parameter
  std::vector<OwnedVector> ds_;                 // of each parameter
  std::vector<std::vector<double>> row_terms_;  // dg/dp_k
  std::vector<double> r_, shifted_;
  std::string message_;  // of a failure that is not in rows_

  // In the shape of IDAS' wrapped vectors, made in the first solve.
  Statistics uncounted_;
  std::unique_ptr<AlgebraicVariables> variables_;
  std::unique_ptr<Polish> polish_;
  OwnedVector id_;
  bool engaged_ = false;
  long setups_ = 0, steps_ = -1;
  std::vector<double> saved_weights_;  // of coupled variables, in the last attempt
  long saved_steps_ = -1;              // accepted before it
};

void Projection::project_sensitivities(Sensitivities sensitivities) {
  own(impl_).project_sensitivities(std::move(sensitivities));
}
ConsistencyReport Projection::make_sensitivities_consistent(double t0, N_Vector yy, N_Vector yp,
                                                            N_Vector* s, N_Vector* sp) {
  return own(impl_).report_of("make_sensitivities_consistent", {yy, yp}, [&] {
    return impl_->make_sensitivities_consistent(t0, yy, yp, s, sp);
  });
}
ConsistencyReport Projection::project_gradient(double t, N_Vector yy, N_Vector v) {
  return own(impl_).report_of("project_gradient", {yy, v},
                              [&] { return impl_->project_gradient(t, yy, v); });
}

void Projection::Impl::project_sensitivities(Sensitivities given) {
  if (rows_.used == nullptr) return;  // no constraints
  const std::string misused = why_misused("project_sensitivities", {});
  if (!misused.empty()) reject(misused);
  sensitivities_ = std::make_unique<SensitivityCorrector>(*this, std::move(given));
}

ConsistencyReport Projection::Impl::make_sensitivities_consistent(double t0, N_Vector yy,
                                                                  N_Vector yp, N_Vector* s,
                                                                  N_Vector* sp) {
  ConsistencyReport report;
  report.status = Status::success;
  if (rows_.used == nullptr) return report;
  if (!sensitivities_)
    reject("make_sensitivities_consistent: call project_sensitivities before, which knows dg/dp");
  if (yy == nullptr || yp == nullptr || s == nullptr)
    reject("make_sensitivities_consistent: yy, yp and s must not be null");
  auto& sensitivities = static_cast<SensitivityCorrector&>(*sensitivities_);
  for (int k = 0; k < sensitivities.count(); ++k)
    for (N_Vector v : {s[k], sp != nullptr ? sp[k] : s[k]})
      if (v == nullptr || !why_unlike_y(v).empty())
        reject("make_sensitivities_consistent: vector " + std::to_string(k) + " of s or sp " +
               (v == nullptr ? "is null" : "is unlike y: " + why_unlike_y(v)));
  current_weights(yy);
  sensitivities.make_consistent(t0, yy, yp, unknowns_.weights, s, sp, report);
  return report;
}

ConsistencyReport Projection::Impl::project_gradient(double t, N_Vector yy, N_Vector v) {
  ConsistencyReport report;
  report.status = Status::success;
  if (yy == nullptr || v == nullptr) reject("project_gradient: yy and v must not be null");
  if (rows_.used == nullptr) return report;
  if (std::holds_alternative<UserProjection>(constraints_.jacobian))
    reject("project_gradient: a UserProjection tells no C; give the rows");
  if (std::holds_alternative<DistributedRows>(constraints_.jacobian))
    reject("project_gradient: DistributedRows are not taken");
  current_weights(yy);
  if (!gradient_) gradient_ = make_rows(constraints_, options_, statistics_, unknowns_.weights);
  RowsAt& rows = *gradient_;
  OwnedVector unit(yy), across(yy);
  N_VConst(1.0, unit);
  std::vector<double> r(static_cast<std::size_t>(rows.count()), 0.0);
  rows.report.fatal = false;
  report.status = rows.linearise(t, yy, unknowns_.weights, nullptr, {});
  if (report.status == Status::success) report.status = rows.factor_in(unit);
  if (report.status == Status::success) report.status = rows.product(v, r);
  if (report.status == Status::success) {
    rows.solve_for(r, across);
    N_VLinearSum(1.0, v, -1.0, across, v);
    report.drift_before = largest(r);
  } else {
    report.message = rows.report.text;
  }
  return report;
}

}  // namespace tether::ida_projection
