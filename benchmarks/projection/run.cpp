// Tether: one run of a test problem by IDA, with or without the projection.
// SPDX-License-Identifier: BSD-3-Clause
#include "run.hpp"

#include <ida/ida.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#ifdef TETHER_HAVE_KLU
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#endif

#include <algorithm>
#include <cstdlib>

#include "context.hpp"

namespace tether::bench {

namespace {

struct Host {
  const problems::Problem* problem;
  Deadline deadline;
};

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  auto* host = static_cast<Host*>(data);
  if (host->deadline.passed()) return -1;
  host->problem->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
  return 0;
}

#ifdef TETHER_HAVE_KLU
int sparse_jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                    void* data, N_Vector, N_Vector, N_Vector) {
  const problems::SparseJacobian& sparse = static_cast<Host*>(data)->problem->sparse;
  std::copy(sparse.starts.begin(), sparse.starts.end(), SUNSparseMatrix_IndexPointers(J));
  std::copy(sparse.rows.begin(), sparse.rows.end(), SUNSparseMatrix_IndexValues(J));
  sparse.fill(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), SUNSparseMatrix_Data(J));
  return 0;
}
#endif

// Dense LU and a difference Jacobian; KLU and the given one where the problem is sparse.
void attach_linear_solver(void* ida, const problems::Problem& problem, N_Vector y,
                          SUNContext context, bool fast, SUNMatrix* matrix,
                          SUNLinearSolver* solver) {
#ifdef TETHER_HAVE_KLU
  if (!problem.sparse.starts.empty()) {
    *matrix =
        SUNSparseMatrix(problem.size, problem.size,
                        static_cast<sunindextype>(problem.sparse.rows.size()), CSC_MAT, context);
    *solver = SUNLinSol_KLU(y, *matrix, context);
    IDASetLinearSolver(ida, *solver, *matrix);
    IDASetJacFn(ida, sparse_jacobian);
    return;
  }
#endif
  *matrix = SUNDenseMatrix(problem.size, problem.size, context);
  *solver = fast && problem.size <= ida_projection::kLargestFastDense
                ? ida_projection::fast_dense_solver(y, *matrix)
                : SUNLinSol_Dense(y, *matrix, context);
  IDASetLinearSolver(ida, *solver, *matrix);
}

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

Run integrate(const problems::Problem& problem, double tolerance, Settings settings) {
  SUNContext context = make_context();
  N_Vector y = vector_of(problem.y0, context), yp = vector_of(problem.yp0, context);
  if (settings.fast) ida_projection::fast_vector(y, yp);
  N_Vector id = vector_of(problem.id, context);
  N_Vector atol = vector_of(absolute_tolerances(problem, tolerance), context);
  void* ida = IDACreate(context);
#ifndef SUN_COMM_NULL
  IDASetErrHandlerFn(ida, silent, nullptr);
#endif
  IDAInit(ida, residual, problem.t0, y, yp);
  IDASVtolerances(ida, tolerance, atol);
  Host host{&problem, Deadline(settings.limits.cpu_seconds, problem.size)};
  IDASetUserData(ida, &host);
  SUNMatrix matrix = nullptr;
  SUNLinearSolver solver = nullptr;
  attach_linear_solver(ida, problem, y, context, settings.fast, &matrix, &solver);
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
      run.message = host.deadline.late() ? "time limit" : std::string(name);
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
