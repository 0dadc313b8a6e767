// Tether: one run of a test problem by IDA, with or without the projection.
// SPDX-License-Identifier: BSD-3-Clause
#include "run.hpp"

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <ctime>

#include "context.hpp"

namespace tether::bench {

namespace {

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  static_cast<const problems::Problem*>(data)->residual(
      t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
  return 0;
}

N_Vector vector_of(const std::vector<double>& values, SUNContext context) {
  N_Vector v = N_VNew_Serial(static_cast<sunindextype>(values.size()), context);
  std::copy(values.begin(), values.end(), N_VGetArrayPointer(v));
  return v;
}

[[maybe_unused]] void silent(int, const char*, const char*, char*, void*) {}

}  // namespace

Run integrate(const problems::Problem& problem, double tolerance,
              const std::optional<ida_projection::Constraints>& constraints,
              ida_projection::Options options, bool suppress, bool give_id, long maximum_steps) {
  SUNContext context = make_context();
  N_Vector y = vector_of(problem.y0, context), yp = vector_of(problem.yp0, context);
  N_Vector id = vector_of(problem.id, context), atol = N_VClone(y);
  for (int i = 0; i < problem.size; ++i)
    N_VGetArrayPointer(atol)[i] =
        tolerance * (problem.atol_scale.empty() ? 1.0 : problem.atol_scale[static_cast<std::size_t>(i)]);
  void* ida = IDACreate(context);
#ifndef SUN_COMM_NULL
  IDASetErrHandlerFn(ida, silent, nullptr);
#endif
  IDAInit(ida, residual, problem.t0, y, yp);
  IDASVtolerances(ida, tolerance, atol);
  IDASetUserData(ida, const_cast<problems::Problem*>(&problem));
  SUNMatrix matrix = SUNDenseMatrix(problem.size, problem.size, context);
  SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, context);
  IDASetLinearSolver(ida, solver, matrix);
  IDASetMaxNumSteps(ida, maximum_steps);
  IDASetStopTime(ida, problem.t_end);
  if (suppress) {
    IDASetId(ida, id);
    IDASetSuppressAlg(ida, 1);
  }

  Run run;
  {
    std::optional<ida_projection::Projection> projection;
    if (constraints) {
      if (give_id) options.id = id;
      projection.emplace(ida, *constraints, options);
    }
    sunrealtype t = problem.t0;
    const std::clock_t begin = std::clock();
    run.flag = IDASolve(ida, problem.t_end, &t, y, yp, IDA_NORMAL);
    run.cpu_ms = 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    run.failed = run.flag < 0;
    run.error = problem.error(N_VGetArrayPointer(y));
    IDAGetNumSteps(ida, &run.steps);
    IDAGetNumResEvals(ida, &run.residuals);
    IDAGetNumErrTestFails(ida, &run.error_failures);
    IDAGetNumNonlinSolvConvFails(ida, &run.solver_failures);
    IDAGetNumLinSolvSetups(ida, &run.jacobians);
    if (projection) {
      run.projection = projection->statistics();
      run.message = projection->message();
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
