// Tether: CVODE's BDF with its own projection. SPDX-License-Identifier: BSD-3-Clause
#include <cvode/cvode.h>
#include <cvode/cvode_proj.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdlib>
#include <tether/linalg/minimum_norm.hpp>

#include "code.hpp"
#include "explicit_form.hpp"
#include "rows_of.hpp"

namespace tether::bench {

namespace {

struct Host {
  const ExplicitForm* form;
  Deadline deadline;
  ida_projection::Constraints rows;
  bool weighted;  // metric: weights of the error test, or plain length
  void* cvode;
  N_Vector weights;
  Eigen::VectorXd y, g, step;
  RowMajor C;
  linalg::MinimumNorm factors;
};

int rates(sunrealtype t, N_Vector y, N_Vector f, void* data) {
  auto* host = static_cast<Host*>(data);
  if (host->deadline.passed()) return -1;
  host->form->evaluate(t, N_VGetArrayPointer(y), N_VGetArrayPointer(f), true);
  return 0;
}

bool factor(Host& host, double t) {
  evaluate_rows(host.rows, t, host.y, host.g, host.C);
  for (Eigen::Index i = 0; i < host.C.rows(); ++i)
    std::copy(host.C.row(i).data(), host.C.row(i).data() + host.C.cols(),
              host.factors.row(static_cast<int>(i)));
  const double* weights = N_VGetArrayPointer(host.weights);
  for (int j = 0; j < host.factors.columns(); ++j)
    host.factors.metric()[j] = host.weighted ? 1.0 / weights[j] : 1.0;
  return host.factors.factor(host.factors.metric(), 1e-9);
}

// As CVODE's guide describes it: the least move, and the part of the error estimate that is
// tangential to the constraints. Analytic rows, one factorisation a step: later moves, which are
// rare, keep the first one's factors (chord), as their error is of second order.
int project(sunrealtype t, N_Vector y_now, N_Vector correction, sunrealtype epsilon, N_Vector error,
            void* data) {
  auto& host = *static_cast<Host*>(data);
  const Eigen::Index N = host.y.size();
  const Eigen::Map<const Eigen::VectorXd> start(N_VGetArrayPointer(y_now), N);
  CVodeGetErrWeights(host.cvode, host.weights);
  const Eigen::Map<const Eigen::VectorXd> weights(N_VGetArrayPointer(host.weights), N);
  host.y = start;
  if (!factor(host, t)) return 1;
  bool there = false;
  for (int move = 0; move < 5 && !there; ++move) {
    if (move > 0) evaluate_values(host.rows, t, host.y, host.g);
    host.factors.solve(host.g.data(), host.step.data());
    host.y -= host.step;
    const double length =
        std::sqrt(host.step.cwiseProduct(weights).squaredNorm() / static_cast<double>(N));
    if (!std::isfinite(length)) return 1;
    there = length <= epsilon;
  }
  if (!there) return 1;
  Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(correction), N) = host.y - start;
  if (!error) return 0;
  Eigen::Map<Eigen::VectorXd> e(N_VGetArrayPointer(error), N);
  host.g.noalias() = host.C * e;
  host.factors.solve(host.g.data(), host.step.data());
  e -= host.step;
  return 0;
}

void read_counts(void* cvode, Run& run) {
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
}

class CvodeCode : public Code {
 public:
  explicit CvodeCode(bool weighted) : weighted_(weighted) {}
  std::string name() const override { return weighted_ ? "CVODE+proj" : "CVODE+proj (length)"; }
  std::string version() const override {
    char text[32] = "";
    SUNDIALSGetVersion(text, sizeof text);
    return std::string("SUNDIALS ") + text;
  }
  std::string refuses(const problems::Problem& problem) const override {
    if (!dense_enough(problem)) return kOnlyDense;
    if (!keeps_something(problem)) return kNothingKept;
    return ExplicitForm(problem).ordinary() ? std::string() : "no ordinary differential equation";
  }

  Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
          const Watch& watch) const override {
    const ExplicitForm form(problem);
    const int N = problem.size;
    SUNContext context = make_context();
    N_Vector y = vector_of(problem.y0, context);
    N_Vector atol = vector_of(absolute_tolerances(problem, tolerance), context);
    void* cvode = CVodeCreate(CV_BDF, context);
    const ida_projection::Constraints rows = problem.recommended_constraints();
    const int m = rows.total_count();
    Host host{&form,
              Deadline(limits.cpu_seconds, N),
              rows,
              weighted_,
              cvode,
              N_VClone(y),
              Eigen::VectorXd(N),
              Eigen::VectorXd(m),
              Eigen::VectorXd(N),
              RowMajor(m, N),
              linalg::MinimumNorm(m, N)};
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
    read_counts(cvode, run);
    if (run.failed) {
      char* flag = CVodeGetReturnFlagName(run.flag);
      run.message = host.deadline.late() ? "time limit" : std::string(flag);
      std::free(flag);
    }
    CVodeFree(&cvode);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    for (N_Vector v : {y, atol, host.weights}) N_VDestroy(v);
    SUNContext_Free(&context);
    return run;
  }

 private:
  bool weighted_;
};

}  // namespace

void add_cvode_code(Codes& codes) {
  codes.push_back(std::make_unique<CvodeCode>(true));
  codes.push_back(std::make_unique<CvodeCode>(false));
}

}  // namespace tether::bench
