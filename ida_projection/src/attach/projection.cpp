// Tether: attaching the projection to IDA. SPDX-License-Identifier: BSD-3-Clause
#include <new>
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

std::unique_ptr<Mover> make_mover(const Constraints& constraints, const Options& options,
                                  Statistics& statistics, N_Vector like) {
  if (!has_rows(constraints)) return nullptr;
  return std::make_unique<Mover>(options, make_rows(constraints, options, statistics, like));
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
      movers_{JoinedRows(constraints_, options_, statistics_, corrector_, variables_), nullptr},
      point_(constraints_, options_),
      watch_{RowFaults(constraints_, statistics_), RejectionWatch(&watch_.faults),
             FirstSteps(constraints_, watch_.faults), BypassWatch(ida_, lifetime_)},
      wanted_metric_(options_.advanced.metric) {
  N_Vector like = vector_of(ida_mem);
  check_running_indices(like);
  validate(constraints_, options_, like);

  unknowns_.contiguous = is_contiguous(like);
  unknowns_.count = like->ops->nvgetlength != nullptr ? static_cast<int>(N_VGetLength(like)) : 0;
  movers_.own = make_mover(constraints_, options_, statistics_, like);
  movers_.used = movers_.own.get();
  if (movers_.used != nullptr) {
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
  if (movers_.used != nullptr) watch_.bypass.begin();
  const StepData step = ida_.step();
  lifetime_.watch(step.y_predicted, step.yp_predicted, [this] {
    std::string ignored;
    guarded([this] { return check_for_bypass(), 0; }, ignored);
  });
  const int flag = IDASetNonlinearSolver(ida_.mem(), solver_.get());
  if (flag != 0)
    reject("IDASetNonlinearSolver returned " + std::to_string(flag) + "; call IDAInit before");
}

Projection::Impl::~Impl() {
  std::string ignored;
  guarded([this] { return check_for_bypass(), 0; }, ignored);
  Operations<Impl>::end(solver_.get(), options_.print);
  lifetime_.free_at_end(solver_.release());
}

Status Projection::Impl::status() {
  check_for_bypass();
  return watch_.bypass.steps() > 0 ? Status::never_called : report_.status_or_warning();
}

const std::string& Projection::Impl::message() {
  check_for_bypass();
  return watch_.bypass.steps() > 0 ? watch_.bypass.text() : report_.text();
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

Statistics Projection::Impl::statistics() {
  check_for_bypass();
  Statistics s = statistics_;
  s.steps_without_plugin = watch_.bypass.steps();
  const long moved = s.projections - s.failures();
  s.mean_move = moved > 0 ? tally_.move_sum / static_cast<double>(moved) : 0.0;
  return s;
}

void Projection::Impl::reset_statistics() {
  statistics_ = Statistics{};
  tally_ = Tally();
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
  return impl_->report_of("make_consistent", {yy, yp},
                          [&] { return impl_->make_consistent(t0, yy, yp, how); });
}

ConsistencyReport Projection::project(double t, N_Vector yy, N_Vector yp) {
  return impl_->report_of("project", {yy, yp}, [&] { return impl_->project(t, yy, yp); });
}
int Projection::solve(double tout, double* tret, N_Vector yret, N_Vector ypret, int itask) {
  return impl_->solve_and_project(tout, tret, yret, ypret, itask);
}
Statistics Projection::statistics() const { return impl_->statistics(); }
void Projection::reset_statistics() { impl_->reset_statistics(); }
Status Projection::status() const { return impl_->status(); }
const std::string& Projection::message() const { return impl_->message(); }
const Constraints& Projection::constraints() const { return impl_->constraints(); }

}  // namespace tether::ida_projection
