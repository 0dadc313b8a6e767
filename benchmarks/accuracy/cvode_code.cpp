// Tether: CVODE's BDF with its own projection. SPDX-License-Identifier: BSD-3-Clause
#include <cvode/cvode.h>
#include <cvode/cvode_proj.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cstdlib>

#include "code.hpp"
#include "explicit_form.hpp"
#include "projection/context.hpp"
#include "rows_of.hpp"

namespace tether::bench {

namespace {

struct Host {
  const ExplicitForm* form;
  ida_projection::Constraints constraints;
  double deadline;
  unsigned calls = 0;
  bool late = false;
  Eigen::VectorXd y, g, weight;
  RowMajor C;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors;
};

int rates(sunrealtype t, N_Vector y, N_Vector f, void* data) {
  auto* host = static_cast<Host*>(data);
  if (++host->calls % 1024 == 0 && cpu_seconds() > host->deadline) {
    host->late = true;
    return -1;
  }
  host->form->evaluate(t, N_VGetArrayPointer(y), N_VGetArrayPointer(f), true);
  return 0;
}

// As CVODE's guide describes it: Gauss-Newton by the least move, and the part of the error estimate
// that is tangential to the constraints.
int project(sunrealtype t, N_Vector y_now, N_Vector correction, sunrealtype epsilon, N_Vector error,
            void* data) {
  auto* host = static_cast<Host*>(data);
  const Eigen::Index N = host->weight.size();
  const Eigen::Map<const Eigen::VectorXd> start(N_VGetArrayPointer(y_now), N);
  Eigen::Map<Eigen::VectorXd> move(N_VGetArrayPointer(correction), N);
  const auto& rows = host->constraints;
  host->y = start;
  auto& factors = host->factors;
  for (int iteration = 0; iteration < 5; ++iteration) {
    evaluate_rows(rows, t, host->y, host->g, host->C);
    factors.compute(host->C);
    const Eigen::VectorXd step = factors.solve(host->g);
    host->y -= step;
    if (!host->y.allFinite()) return 1;
    const double length =
        std::sqrt(step.cwiseProduct(host->weight).squaredNorm() / static_cast<double>(N));
    if (length <= epsilon) {
      move = host->y - start;
      if (error) {
        Eigen::Map<Eigen::VectorXd> e(N_VGetArrayPointer(error), N);
        e -= factors.solve(host->C * e).eval();
      }
      return 0;
    }
  }
  return 1;
}

[[maybe_unused]] void silent(int, const char*, const char*, char*, void*) {}

class CvodeCode : public Code {
 public:
  std::string name() const override { return "CVODE+proj"; }
  std::string version() const override {
    char text[32] = "";
    SUNDIALSGetVersion(text, sizeof text);
    return std::string("SUNDIALS ") + text;
  }
  std::string refuses(const problems::Problem& problem) const override {
    return ExplicitForm(problem).ordinary() ? std::string() : "no ordinary differential equation";
  }

  Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
          const Watch& watch) const override {
    const ExplicitForm form(problem);
    const int N = problem.size;
    SUNContext context = make_context();
    N_Vector y = N_VNew_Serial(N, context), atol = N_VClone(y);
    std::copy(problem.y0.begin(), problem.y0.end(), N_VGetArrayPointer(y));
    Host host{&form,
              problem.recommended_constraints(),
              cpu_seconds() + limits.cpu_seconds,
              0,
              false,
              {},
              {},
              Eigen::VectorXd(N),
              {},
              {}};
    host.factors.setThreshold(1e-9);
    for (int i = 0; i < N; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double absolute =
          tolerance * (problem.atol_scale.empty() ? 1.0 : problem.atol_scale[k]);
      N_VGetArrayPointer(atol)[i] = absolute;
      host.weight[i] = 1.0 / (tolerance * std::abs(problem.y0[k]) + absolute);
    }
    void* cvode = CVodeCreate(CV_BDF, context);
#ifndef SUN_COMM_NULL
    CVodeSetErrHandlerFn(cvode, silent, nullptr);
#endif
    CVodeInit(cvode, rates, problem.t0, y);
    CVodeSVtolerances(cvode, tolerance, atol);
    CVodeSetUserData(cvode, &host);
    SUNMatrix matrix = SUNDenseMatrix(N, N, context);
    SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, context);
    CVodeSetLinearSolver(cvode, solver, matrix);
    CVodeSetMaxNumSteps(cvode, limits.steps);
    CVodeSetStopTime(cvode, problem.t_end);
    CVodeSetProjFn(cvode, project);

    Run run;
    sunrealtype t = problem.t0;
    const double begin = cpu_seconds();
    do {
      run.flag = CVode(cvode, problem.t_end, y, &t, watch ? CV_ONE_STEP : CV_NORMAL);
      int order = 0;
      CVodeGetLastOrder(cvode, &order);
      if (watch && run.flag >= 0) watch(t, N_VGetArrayPointer(y), order);
    } while (watch && run.flag >= 0 && t < problem.t_end);
    run.cpu_ms = 1e3 * (cpu_seconds() - begin);
    run.failed = run.flag < 0;
    run.y.assign(N_VGetArrayPointer(y), N_VGetArrayPointer(y) + N);
    run.error = problem.error(run.y.data());
    long differences = 0;
    CVodeGetNumSteps(cvode, &run.steps);
    CVodeGetNumRhsEvals(cvode, &run.residuals);
    CVodeGetNumLinRhsEvals(cvode, &differences);
    run.residuals += differences;
    CVodeGetNumErrTestFails(cvode, &run.error_failures);
    CVodeGetNumNonlinSolvConvFails(cvode, &run.solver_failures);
    CVodeGetNumJacEvals(cvode, &run.jacobians);
    CVodeGetNumLinSolvSetups(cvode, &run.factorizations);
    CVodeGetNumProjEvals(cvode, &run.projections);
    if (run.failed) {
      char* flag = CVodeGetReturnFlagName(run.flag);
      run.message = host.late ? "time limit" : std::string(flag);
      std::free(flag);
    }
    CVodeFree(&cvode);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    N_VDestroy(y);
    N_VDestroy(atol);
    SUNContext_Free(&context);
    return run;
  }
};

}  // namespace

void add_cvode_code(Codes& codes) { codes.push_back(std::make_unique<CvodeCode>()); }

}  // namespace tether::bench
