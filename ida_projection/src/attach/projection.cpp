// Tether: attaching the projection to IDA. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <new>
#include <stdexcept>
#include <tether/ida_projection/projection.hpp>

#include "attach/impl.hpp"
#include "host/operations.hpp"

namespace tether::ida_projection {

namespace {

// A vector of the host's problem; refuses an IDA that has none.
N_Vector vector_of(void* ida_mem) {
  if (ida_mem == nullptr) reject("ida_mem is null; pass what IDACreate returned");
  N_Vector y_predicted = Ida(ida_mem).step().y_predicted;
  if (y_predicted == nullptr) reject("ida_mem is not initialised; call IDAInit before");
  return y_predicted;
}

}  // namespace

Projection::Impl::Impl(void* ida_mem, Constraints set, Options options)
    : constraints_(std::move(set)),
      options_(std::move(options)),
      ida_(ida_mem),
      report_(options_, statistics_),
      corrector_(options_.nonlinear_solver, vector_of(ida_mem)),
      variables_(statistics_),
      polish_(options_, statistics_, corrector_, variables_),
      control_(ida_, options_, statistics_),
      rows_{JoinedRows(constraints_, options_, statistics_, corrector_, variables_), nullptr},
      point_(constraints_, options_),
      start_(ida_, options_, corrector_, variables_, rows_.joined, point_),
      observer_(constraints_, options_, statistics_, report_, ida_, lifetime_, corrector_,
                variables_),
      wanted_metric_(options_.advanced.metric) {
  N_Vector like = vector_of(ida_mem);
  check_running_indices(like);
  validate(constraints_, options_, like);

  unknowns_.contiguous = is_contiguous(like);
  unknowns_.count = like->ops->nvgetlength != nullptr ? static_cast<int>(N_VGetLength(like)) : 0;
  if (has_rows(constraints_)) {
    rows_.own = make_rows(constraints_, options_, statistics_, like);
    rows_.used = rows_.own.get();
    polish_.allocate(like);
    polish_.allow_forecasts();
    unknowns_.weights = OwnedVector(like);
    if (options_.id != nullptr) {
      variables_.set(options_.id);
      options_.id = variables_.vector();  // the caller's vector may go
    }
    if (unknowns_.contiguous && options_.advanced.hold_vector != nullptr && options_.hold.empty()) {
      const double* free = N_VGetArrayPointer(options_.advanced.hold_vector);
      for (int j = 0; j < unknowns_.count; ++j) options_.hold.push_back(free[j] == 0.0);
    }
  }
  if (corrector_.inner() != nullptr)
    solver_.reset(Operations<Impl>::make(*this, corrector_.inner(), like->sunctx));
  if (!solver_) throw std::bad_alloc();
  attach();
}

// IDASetNonlinearSolver frees IDA's own solver before it refuses another one. The other one is
// therefore tested before.
void Projection::Impl::attach() {
  const SUNNonlinSolSysFn nothing = [](N_Vector, N_Vector, void*) { return 0; };
  const SUNNonlinSolConvTestFn converged = [](SUNNonlinearSolver, N_Vector, N_Vector, sunrealtype,
                                              N_Vector, void*) { return 0; };
  const auto require = [](int flag, const char* what) {
    if (flag != 0)
      reject("options.nonlinear_solver refuses " + std::string(what) + ", flag " +
             std::to_string(flag) + "; IDA needs all of its functions");
  };
  require(SUNNonlinSolSetSysFn(solver_.get(), nothing), "a system function");
  require(SUNNonlinSolSetConvTestFn(solver_.get(), converged, nullptr), "a convergence test");
  require(SUNNonlinSolSetMaxIters(solver_.get(), corrector_.maximum_iterations()),
          "a number of iterations");
  if (rows_.used != nullptr) observer_.attached();
  const StepData step = ida_.step();
  lifetime_.watch(step.y_predicted, step.yp_predicted, [this] {
    std::string ignored;
    guarded([this] { return bypassed(), 0; }, ignored);
  });
  const int flag = IDASetNonlinearSolver(ida_.mem(), solver_.get());
  if (flag != 0)
    reject("IDASetNonlinearSolver returned " + std::to_string(flag) + "; call IDAInit before");
}

Projection::Impl::~Impl() {
  std::string ignored;
  guarded([this] { return bypassed(), 0; }, ignored);
  Operations<Impl>::end(solver_.get(), options_.print);
  lifetime_.free_at_end(solver_.release());
}

Status Projection::Impl::status() {
  return bypassed() ? Status::never_called : report_.status_or_warning();
}

const std::string& Projection::Impl::message() {
  return bypassed() ? observer_.bypass_text() : report_.text();
}

Statistics Projection::Impl::statistics() {
  bypassed();
  return observer_.statistics();
}

std::string Projection::Impl::why_misused(const char* function,
                                          std::initializer_list<N_Vector> vectors) const {
  const auto name = [&] { return std::string(function) + ": "; };
  if (lifetime_.over()) return name() + "IDAFree has freed the ida_mem; call it before";
  if (busy_ != Busy::no)
    return name() + "called from a function that the plugin is calling; call it between the steps";
  for (N_Vector v : vectors) {
    const std::string wrong = v != nullptr ? why_unlike_y(v) : std::string();
    if (!wrong.empty()) return name() + wrong;
  }
  return {};
}

std::string Projection::Impl::why_unlike_y(N_Vector v) const {
  const long length = v->ops->nvgetlength != nullptr ? static_cast<long>(N_VGetLength(v)) : 0;
  if (length != unknowns_.count)
    return "a vector has " + std::to_string(length) + " entries; y has " +
           std::to_string(unknowns_.count);
  if (unknowns_.contiguous && !is_contiguous(v))
    return "a vector is not contiguous in this process, as those of IDA are";
  return {};
}

ConsistencyReport Projection::Impl::make_consistent(double t0, N_Vector yy, N_Vector yp,
                                                    const Consistency& how) {
  if (yy == nullptr || yp == nullptr) reject("make_consistent: yy and yp must not be null");
  if (!how.hold.empty() && static_cast<int>(how.hold.size()) != unknowns_.count)
    reject("make_consistent: hold has " + std::to_string(how.hold.size()) + " entries for " +
           std::to_string(unknowns_.count) + " unknowns");
  if (static_cast<int>(how.derivative) < 0 || how.derivative > Consistency::Derivative::keep)
    reject("make_consistent: derivative = " + std::to_string(static_cast<int>(how.derivative)) +
           "; it must be one of Consistency::Derivative");
  ConsistencyReport report;
  report.status = Status::success;
  if (!rows_.used) return report;
  report = start_.make(t0, yy, yp, how, unknowns_.weights, history_.reached());
  if (report) reset_statistics();
  if (report.status == Status::internal_error &&
      run_.phase == Phase::broken) {  // an exception says more
    report.status = report_.status;
    report.message = report_.message;
  }
  return report;
}

ConsistencyReport Projection::Impl::project(double t, N_Vector yy, N_Vector yp) {
  if (yy == nullptr) reject("project: yy must not be null");
  ConsistencyReport report;
  report.status = Status::success;
  if (!rows_.used) return report;
  current_weights(yy);
  const OwnedVector y = copy_of(yy), ydot = copy_of(yp);
  point_.project(t, y, {}, variables_.id(), unknowns_.weights, report);
  const bool turned = report.status == Status::success && ydot &&
                      point_.tangent(t, y, ydot, variables_.id(), report);
  if (report.status != Status::success) return report;
  note_changes(report, unknowns_.weights, yy, y, yp,
               turned ? static_cast<N_Vector>(ydot) : nullptr);
  N_VScale(1.0, y, yy);
  if (turned) N_VScale(1.0, ydot, yp);
  return report;
}

// IDA's present error weights; before its first step, weights of relative size.
void Projection::Impl::current_weights(N_Vector y) {
  N_Vector weights = unknowns_.weights;
  if (run_.phase != Phase::late && IDAGetErrWeights(ida_.mem(), weights) == 0) {
    N_VScale(1.0 / control_.weights_factor(), weights, weights);
    return;
  }
  N_VAbs(y, weights);
  N_VAddConst(weights, 1.0, weights);
  N_VInv(weights, weights);
  N_VScale(1e6, weights, weights);  // of a tolerance of 1e-6
}

int Projection::Impl::solve_and_project(double tout, double* tret, N_Vector yret, N_Vector ypret,
                                        int itask) {
  const std::string misused = why_misused("solve", {yret, ypret});
  if (!misused.empty()) {
    report_.status = Status::misused;
    report_.message = misused;
    return lifetime_.over() ? IDA_MEM_NULL : IDA_ILL_INPUT;
  }
  const int flag = IDASolve(ida_.mem(), tout, tret, yret, ypret, itask);
  if (flag < 0 || !rows_.used || bypassed()) return flag;
  // A point at the end of a step is projected already, an interpolated one is not.
  const Status of_step = report_.status;
  const std::string text = report_.message;
  if (!report_of("solve", {}, [&] { return project(*tret, yret, ypret); })) return flag;
  report_.status = of_step;
  report_.message = text;
  return flag;
}

Projection::Projection(void* ida_mem, Constraints constraints, Options options,
                       const SundialsBuild& built) {
  check_running_sundials(built);
  impl_ = std::make_unique<Impl>(ida_mem, std::move(constraints), std::move(options));
}
Projection::~Projection() = default;
Projection::Projection(Projection&&) noexcept = default;
Projection& Projection::operator=(Projection&&) noexcept = default;

ConsistencyReport Projection::make_consistent(double t0, N_Vector yy, N_Vector yp,
                                              const Consistency& how) {
  return own(impl_).report_of("make_consistent", {yy, yp},
                              [&] { return impl_->make_consistent(t0, yy, yp, how); });
}

ConsistencyReport Projection::project(double t, N_Vector yy, N_Vector yp) {
  return own(impl_).report_of("project", {yy, yp}, [&] { return impl_->project(t, yy, yp); });
}
int Projection::solve(double tout, double* tret, N_Vector yret, N_Vector ypret, int itask) {
  return own(impl_).solve_and_project(tout, tret, yret, ypret, itask);
}
Statistics Projection::statistics() const { return own(impl_).statistics(); }
void Projection::reset_statistics() { own(impl_).reset_statistics(); }
Status Projection::status() const { return own(impl_).status(); }
const std::string& Projection::message() const { return own(impl_).message(); }

}  // namespace tether::ida_projection
