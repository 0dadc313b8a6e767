// Tether: one run of a test problem by IDA, with or without the projection.
// SPDX-License-Identifier: BSD-3-Clause
#include "run.hpp"

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>

#include "context.hpp"

namespace tether::bench {

namespace {

struct Host {
  const problems::Problem* problem;
  double deadline;
  unsigned calls = 0;
  bool late = false;
};

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  auto* host = static_cast<Host*>(data);
  // Reading the clock costs as much as a small F.
  if (++host->calls % 1024 == 0 && cpu_seconds() > host->deadline) {
    host->late = true;
    return -1;
  }
  host->problem->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
  return 0;
}

N_Vector vector_of(const std::vector<double>& values, SUNContext context) {
  N_Vector v = N_VNew_Serial(static_cast<sunindextype>(values.size()), context);
  std::copy(values.begin(), values.end(), N_VGetArrayPointer(v));
  return v;
}

[[maybe_unused]] void silent(int, const char*, const char*, char*, void*) {}

int watched_solve(void* ida, const problems::Problem& problem, const Watch& watch, N_Vector y,
                  N_Vector yp, sunrealtype* t) {
  int flag = IDA_SUCCESS;
  while (flag >= 0 && *t < problem.t_end) {
    flag = IDASolve(ida, problem.t_end, t, y, yp, IDA_ONE_STEP);
    if (flag < 0) break;
    int order = 0;
    IDAGetLastOrder(ida, &order);
    watch(*t, N_VGetArrayPointer(y), order);
  }
  return flag;
}

void read_counts(void* ida, Run& run) {
  long differences = 0;
  IDAGetNumSteps(ida, &run.steps);
  IDAGetNumResEvals(ida, &run.residuals);
  IDAGetNumLinResEvals(ida, &differences);
  run.residuals += differences;
  IDAGetNumErrTestFails(ida, &run.error_failures);
  IDAGetNumNonlinSolvConvFails(ida, &run.solver_failures);
  IDAGetNumJacEvals(ida, &run.jacobians);
  IDAGetNumLinSolvSetups(ida, &run.factorizations);
}

}  // namespace

double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Run integrate(const problems::Problem& problem, double tolerance, Settings settings) {
  SUNContext context = make_context();
  N_Vector y = vector_of(problem.y0, context), yp = vector_of(problem.yp0, context);
  N_Vector id = vector_of(problem.id, context), atol = N_VClone(y);
  for (int i = 0; i < problem.size; ++i)
    N_VGetArrayPointer(atol)[i] =
        tolerance *
        (problem.atol_scale.empty() ? 1.0 : problem.atol_scale[static_cast<std::size_t>(i)]);
  void* ida = IDACreate(context);
#ifndef SUN_COMM_NULL
  IDASetErrHandlerFn(ida, silent, nullptr);
#endif
  IDAInit(ida, residual, problem.t0, y, yp);
  IDASVtolerances(ida, tolerance, atol);
  Host host{&problem, cpu_seconds() + settings.limits.cpu_seconds};
  IDASetUserData(ida, &host);
  SUNMatrix matrix = SUNDenseMatrix(problem.size, problem.size, context);
  SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, context);
  IDASetLinearSolver(ida, solver, matrix);
  // One-step mode counts each call: the limit then holds for one step only.
  IDASetMaxNumSteps(ida, settings.limits.steps);
  IDASetStopTime(ida, problem.t_end);
  if (problem.initial_step > 0.0) IDASetInitStep(ida, problem.initial_step);
  if (settings.suppress) {
    IDASetId(ida, id);
    IDASetSuppressAlg(ida, 1);
  }

  Run run;
  {
    std::optional<ida_projection::Projection> projection;
    if (settings.constraints) {
      if (settings.give_id) settings.options.id = id;
      projection.emplace(ida, *settings.constraints, settings.options);
    }
    sunrealtype t = problem.t0;
    const double begin = cpu_seconds();
    run.flag = settings.watch ? watched_solve(ida, problem, settings.watch, y, yp, &t)
                              : IDASolve(ida, problem.t_end, &t, y, yp, IDA_NORMAL);
    run.cpu_ms = 1e3 * (cpu_seconds() - begin);
    run.failed = run.flag < 0;
    run.error = problem.error(N_VGetArrayPointer(y));
    run.y.assign(N_VGetArrayPointer(y), N_VGetArrayPointer(y) + problem.size);
    read_counts(ida, run);
    if (projection) {
      run.projection = projection->statistics();
      run.projections = run.projection.projections;
      run.message = projection->message();
    }
    if (run.failed && run.message.empty()) {
      char* name = IDAGetReturnFlagName(run.flag);
      run.message = host.late ? "time limit" : std::string(name);
      std::free(name);
    }
    IDAFree(&ida);
  }
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  for (N_Vector v : {y, yp, id, atol}) N_VDestroy(v);
  SUNContext_Free(&context);
  return run;
}

}  // namespace tether::bench
