// Tether: CPodes of Simbody with its own projection, as a module. SPDX-License-Identifier:
// BSD-3-Clause
//
// Simbody's library has functions of an old SUNDIALS inside, under the names of today's. A module
// opened with RTLD_DEEPBIND keeps each library with its own.
#include <simmath/internal/SimTKcpodes.h>

#include <algorithm>
#include <cmath>

#include "code.hpp"
#include "explicit_form.hpp"

namespace tether::bench {

namespace {

class CpodesCode : public Code {
 public:
  std::string name() const override { return "CPodes"; }
  std::string version() const override { return "of libsimbody"; }
  std::string refuses(const problems::Problem& problem) const override {
    if (!dense_enough(problem)) return kOnlyDense;
    if (!keeps_something(problem)) return kNothingKept;
    // Simbody's vectors lack the minimum that CPodes wants of a tolerance for each component.
    if (!problem.atol_scale.empty()) return "takes one absolute tolerance only";
    return ExplicitForm(problem).ordinary() ? std::string() : "no ordinary differential equation";
  }
  Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
          const Watch& watch) const override;
};

class System : public SimTK::CPodesSystem {
 public:
  System(const problems::Problem& problem, const ExplicitForm& form, double seconds)
      : form_(form), rows_(problem.recommended_constraints()), deadline_(seconds, problem.size) {
    for (const auto* part : parts()) count_ += part->count;
  }

  int explicitODE(SimTK::Real t, const SimTK::Vector& y, SimTK::Vector& f) const override {
    if (deadline_.passed()) return SimTK::CPodes::UnrecoverableError;
    form_.evaluate(t, &y[0], &f[0], true);
    return SimTK::CPodes::Success;
  }

  int constraint(SimTK::Real t, const SimTK::Vector& y, SimTK::Vector& g) const override {
    int first = 0;
    for (const auto* part : parts()) {
      part->value(t, ida_projection::ConstVector(&y[0], y.size()),
                  ida_projection::Vector(&g[0] + first, part->count));
      first += part->count;
    }
    return SimTK::CPodes::Success;
  }

  void errorHandler(int, const char*, const char*, char*) const override {}

  int count() const { return count_; }
  const Deadline& deadline() const { return deadline_; }

 private:
  std::vector<const ida_projection::Constraints*> parts() const {
    std::vector<const ida_projection::Constraints*> all{&rows_};
    for (const auto& part : rows_.joined) all.push_back(&part);
    return all;
  }
  const ExplicitForm& form_;
  ida_projection::Constraints rows_;
  mutable Deadline deadline_;
  int count_ = 0;
};

Run CpodesCode::run(const problems::Problem& problem, double tolerance, const Limits& limits,
                    const Watch& watch) const {
  using SimTK::CPodes;
  const ExplicitForm form(problem);
  System system(problem, form, limits.cpu_seconds);
  const int N = problem.size;
  SimTK::Vector y(N), yp(N), ctol(system.count(), tolerance);
  SimTK::Real atol = tolerance;
  for (int i = 0; i < N; ++i) {
    const auto k = static_cast<std::size_t>(i);
    y[i] = problem.y0[k];
    yp[i] = problem.yp0[k];
  }
  Run run;
  CPodes cpodes(CPodes::ExplicitODE, CPodes::BDF, CPodes::Newton);
  cpodes.setErrHandlerFn();
  cpodes.init(system, problem.t0, y, yp, CPodes::ScalarScalar, tolerance, &atol);
  cpodes.lapackDense(N);
  // In its other norm, ErrorNorm, every projection fails (return code -55).
  // Rows may depend on each other: QR with pivoting is the choice that its guide gives for that.
  cpodes.projInit(CPodes::L2Norm, CPodes::Nonlinear, ctol);
  cpodes.lapackDenseProj(system.count(), N, CPodes::ProjectWithQRPivot);
  cpodes.setMaxNumSteps(static_cast<int>(limits.steps));
  cpodes.setStopTime(problem.t_end);
  SimTK::Real t = problem.t0;
  const double begin = cpu_seconds();
  do {
    run.flag =
        cpodes.step(problem.t_end, &t, y, yp, watch ? CPodes::OneStepTstop : CPodes::NormalTstop);
    int order = 0;
    cpodes.getLastOrder(&order);
    if (watch && run.flag >= 0) watch(t, &y[0], order);
  } while (watch && run.flag >= 0 && t < problem.t_end);
  run.cpu_ms = 1e3 * (cpu_seconds() - begin);
  run.failed = run.flag < 0;
  run.y.assign(&y[0], &y[0] + N);
  run.error = problem.error(run.y.data());
  run.residuals = system.deadline().calls();
  int steps = 0, setups = 0, jacobians = 0, error_failures = 0, failures = 0, projections = 0;
  cpodes.getNumSteps(&steps);
  cpodes.getNumLinSolvSetups(&setups);
  cpodes.dlsGetNumJacEvals(&jacobians);
  cpodes.getNumErrTestFails(&error_failures);
  cpodes.getNumNonlinSolvConvFails(&failures);
  cpodes.getProjNumProj(&projections);
  run.steps = steps;
  run.factorizations = setups;
  run.jacobians = jacobians;
  run.error_failures = error_failures;
  run.solver_failures = failures;
  run.projections = projections;
  if (run.failed)
    run.message =
        system.deadline().late() ? "time limit" : "return code " + std::to_string(run.flag);
  return run;
}

}  // namespace

}  // namespace tether::bench

extern "C" tether::bench::Code* tether_make_cpodes() { return new tether::bench::CpodesCode; }
