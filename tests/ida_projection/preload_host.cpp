// A host of libtether_preload that asks for more than constraints: its own nonlinear solver and
// output on the rows. SPDX-License-Identifier: BSD-3-Clause
//
// Links SUNDIALS only; finds the library, which LD_PRELOAD names, when it runs. Exit code 77: it is
// not there.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <dlfcn.h>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <tether/ida_preload.h>

namespace {

template <class Function>
Function* loaded(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}
#define LOADED(name) loaded(static_cast<decltype(&name)>(nullptr), #name)

double length_square = 0;  // of the start that the library hands on
bool own_solver = false;   // is that of the options

double off(const double* y) { return std::abs(y[0] * y[0] + y[1] * y[1] - 4) / 2; }

int pendulum(sunrealtype, N_Vector yy, N_Vector yp, N_Vector rr, void*) {
  const double *y = N_VGetArrayPointer(yy), *dy = N_VGetArrayPointer(yp);
  double* r = N_VGetArrayPointer(rr);
  r[0] = dy[0] - y[2];
  r[1] = dy[1] - y[3];
  r[2] = dy[2] + y[0] * y[4];
  r[3] = dy[3] + y[1] * y[4] + 1;
  r[4] = y[2] * y[2] + y[3] * y[3] - y[1] - 4 * y[4];
  return 0;
}

int rows(sunrealtype, const sunrealtype* y, sunrealtype* g, void*) {
  g[0] = (y[0] * y[0] + y[1] * y[1] - length_square) / 2;
  return 0;
}

int jacobian(sunrealtype, const sunrealtype* y, sunrealtype* C, void*) {
  C[0] = y[0], C[1] = y[1];
  return 0;
}

int ask(void* ida_mem, N_Vector y, tether_constraints* constraints, tether_options* options) {
  const double* start = N_VGetArrayPointer(y);
  length_square = start[0] * start[0] + start[1] * start[1];
  own_solver = options->nonlinear_solver != nullptr;
  LOADED(tether_preload_project_output)(ida_mem);
  return LOADED(tether_add_rows)(constraints, 1, rows, jacobian, nullptr);
}

int wrong = 0;
void expect(bool holds, const char* what, double value) {
  if (holds) return;
  std::fprintf(stderr, "%s: %g\n", what, value);
  wrong = 1;
}

}  // namespace

int main() {
  const auto register_rows = LOADED(tether_preload_ask);
  if (register_rows == nullptr) return 77;
  register_rows(ask);
  SUNContext context = nullptr;
#ifdef SUN_COMM_NULL  // SUNDIALS 7
  SUNContext_Create(SUN_COMM_NULL, &context);
#else
  SUNContext_Create(nullptr, &context);
#endif
  N_Vector y = N_VNew_Serial(5, context), yp = N_VClone(y);
  N_VConst(0.0, y);
  N_VConst(0.0, yp);
  N_VGetArrayPointer(y)[0] = 2;
  N_VGetArrayPointer(yp)[3] = -1;
  void* ida = IDACreate(context);
  IDAInit(ida, pendulum, 0.0, y, yp);
  IDASStolerances(ida, 1e-5, 1e-5);
  SUNMatrix matrix = SUNDenseMatrix(5, 5, context);
  SUNLinearSolver linear = SUNLinSol_Dense(y, matrix, context);
  IDASetLinearSolver(ida, linear, matrix);
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(y, context);
  IDASetNonlinearSolver(ida, newton);
  N_VConst(7.0, y);  // the start is that of IDAInit, whatever becomes of its vector

  double worst = 0, t = 0;
  for (int k = 1; k <= 50; ++k) {
    const int flag = IDASolve(ida, 0.1 * k, &t, y, yp, IDA_NORMAL);
    expect(flag >= 0, "IDASolve", flag);
    if (wrong) return 1;
    worst = std::max(worst, off(N_VGetArrayPointer(y)));
    double last = 0, reached = 0;
    IDAGetLastStep(ida, &last);
    IDAGetCurrentTime(ida, &reached);
    IDAGetDky(ida, reached - 0.4 * last, 0, y);
    worst = std::max(worst, off(N_VGetArrayPointer(y)));
  }
  expect(std::abs(length_square - 4) < 1e-15, "not the start of IDAInit", length_square);
  expect(own_solver, "the host's nonlinear solver is not told", 0);
  expect(worst < 1e-12, "output off the rows by", worst);
  long iterations = 0;
  SUNNonlinSolGetNumIters(newton, &iterations);
  expect(iterations > 0, "iterations of the host's nonlinear solver", double(iterations));

  IDAFree(&ida);
  SUNNonlinSolFree(newton);
  SUNLinSolFree(linear);
  SUNMatDestroy(matrix);
  N_VDestroy(y);
  N_VDestroy(yp);
  SUNContext_Free(&context);
  return wrong;
}
