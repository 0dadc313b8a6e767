// Tether: one run of IDA, with or without the projection. SPDX-License-Identifier: BSD-3-Clause
#include "integrate.hpp"

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <problems/pendulum.hpp>
#include <tether/ida_projection.hpp>

namespace pendulum {

namespace {

using tether::ida_projection::Projection;
using tether::problems::Problem;

constexpr long kMaximumSteps = 1200000;

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* problem) {
  static_cast<const Problem*>(problem)->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp),
                                                 N_VGetArrayPointer(r));
  return 0;
}

/// IDA's memory, set up for one problem. Failures are shown in the table, so IDA is kept silent.
struct Ida {
  SUNContext context = nullptr;
  N_Vector y = nullptr, yp = nullptr;
  SUNMatrix matrix = nullptr;
  SUNLinearSolver solver = nullptr;
  void* memory = nullptr;

  Ida(const Problem& problem, double tolerance) {
#ifdef SUN_COMM_NULL  // SUNDIALS 7
    SUNContext_Create(SUN_COMM_NULL, &context);
    SUNContext_ClearErrHandlers(context);
#else
    SUNContext_Create(nullptr, &context);
#endif
    const sunindextype n = problem.size;
    y = N_VNew_Serial(n, context);
    yp = N_VNew_Serial(n, context);
    std::copy(problem.y0.begin(), problem.y0.end(), N_VGetArrayPointer(y));
    std::copy(problem.yp0.begin(), problem.yp0.end(), N_VGetArrayPointer(yp));
    matrix = SUNDenseMatrix(n, n, context);
    solver = SUNLinSol_Dense(y, matrix, context);

    memory = IDACreate(context);
#ifndef SUN_COMM_NULL
    IDASetErrFile(memory, nullptr);
#endif
    IDAInit(memory, residual, problem.t0, y, yp);
    IDASetUserData(memory, const_cast<Problem*>(&problem));
    IDASStolerances(memory, tolerance, tolerance);
    IDASetLinearSolver(memory, solver, matrix);
    IDASetMaxNumSteps(memory, kMaximumSteps);
    IDASetStopTime(memory, problem.t_end);
  }
  ~Ida() {
    IDAFree(&memory);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    N_VDestroy(yp);
    N_VDestroy(y);
    SUNContext_Free(&context);
  }
  Ida(const Ida&) = delete;
  Ida& operator=(const Ida&) = delete;

  long steps() const {
    long count = 0;
    IDAGetNumSteps(memory, &count);
    return count;
  }
};

std::string name_of(int flag) {
  char* text = IDAGetReturnFlagName(flag);
  const std::string name = text;
  std::free(text);
  return name;
}

/// One call, as a program would make it.
int solve(Ida& ida, double end, double& t) {
  return IDASolve(ida.memory, end, &t, ida.y, ida.yp, IDA_NORMAL);
}

/// The same steps, recorded one by one.
int solve(Ida& ida, double end, double& t, const Observer& observer) {
  int flag = IDA_SUCCESS;
  while (flag == IDA_SUCCESS && t < end) {
    flag = ida.steps() < kMaximumSteps ? IDASolve(ida.memory, end, &t, ida.y, ida.yp, IDA_ONE_STEP)
                                       : IDA_TOO_MUCH_WORK;
    if (flag >= 0) observer(t, N_VGetArrayPointer(ida.y));
  }
  return flag;
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace

Problem problem_of(const Experiment& experiment, const std::string& form) {
  return tether::problems::pendulum(experiment.length, experiment.gravity, experiment.duration,
                                    form);
}

Outcome integrate(const Problem& problem, const Case& what, const Observer& observer) {
  std::optional<Projection> projection;  // ends after IDA's memory, which refers to it
  Ida ida(problem, what.tolerance);
  if (!what.plain()) projection.emplace(ida.memory, problem.select(what.rows()));

  Outcome outcome;
  double t = problem.t0;
  const double begin = cpu_seconds();
  const int flag = observer ? solve(ida, problem.t_end, t, observer) : solve(ida, problem.t_end, t);
  outcome.cpu_ms = 1e3 * (cpu_seconds() - begin);

  if (flag < 0) outcome.failure = name_of(flag);
  IDAGetCurrentTime(ida.memory, &outcome.reached);
  outcome.error = problem.error(N_VGetArrayPointer(ida.y));
  outcome.steps = ida.steps();
  IDAGetNumResEvals(ida.memory, &outcome.residuals);
  return outcome;
}

}  // namespace pendulum
