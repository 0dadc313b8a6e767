// Tether: a pendulum with IDA, before and after the plugin. SPDX-License-Identifier: BSD-3-Clause
//
// In the style of SUNDIALS' idaRoberts_dns.c. Unknowns x, y, vx, vy and the tension lambda; L = g =
// m = 1. Index 1: the length x^2 + y^2 = 1 has been differentiated twice. The pendulum starts
// horizontally at rest, and after each period it is there again.
#include <cmath>
#include <cstdio>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection.hpp>

#define NEQ 5
#define PERIOD 7.4162987092054876737354013887173  // 4 K(1/2)
#define NPERIODS 100

static int pendulum(sunrealtype t, N_Vector yy, N_Vector yp, N_Vector rr, void* user_data);
static int check(int flag, const char* name);
static tether::ida_projection::Constraints constraints();

int main() {
  SUNContext ctx;
#ifdef SUN_COMM_NULL  // SUNDIALS 7
  SUNContext_Create(SUN_COMM_NULL, &ctx);
#else
  SUNContext_Create(NULL, &ctx);
#endif

  N_Vector yy = N_VNew_Serial(NEQ, ctx);
  N_Vector yp = N_VNew_Serial(NEQ, ctx);
  N_VConst(0.0, yy);
  N_VConst(0.0, yp);
  sunrealtype* y = N_VGetArrayPointer(yy);
  y[0] = 1.0;
  N_VGetArrayPointer(yp)[3] = -1.0;

  tether::ida_projection::fast_vector(yy, yp);
  void* ida_mem = IDACreate(ctx);
  if (check(IDAInit(ida_mem, pendulum, 0.0, yy, yp), "IDAInit")) return 1;
  const tether::ida_projection::Constraints c = constraints();
  tether::ida_projection::Projection projection(ida_mem, c);
  if (check(IDASStolerances(ida_mem, 1e-6, 1e-6), "IDASStolerances")) return 1;
  SUNMatrix A = SUNDenseMatrix(NEQ, NEQ, ctx);
  SUNLinearSolver LS = SUNLinSol_Dense(yy, A, ctx);
  if (check(IDASetLinearSolver(ida_mem, LS, A), "IDASetLinearSolver")) return 1;
  if (check(IDASetMaxNumSteps(ida_mem, 1000000), "IDASetMaxNumSteps")) return 1;

  printf("periods  |end - start|   length - 1      energy\n");
  for (int n = 1; n <= NPERIODS; n *= 10) {
    sunrealtype t;
    if (check(IDASolve(ida_mem, n * PERIOD, &t, yy, yp, IDA_NORMAL), "IDASolve")) return 1;
    printf("%7d  %13.1e %12.1e %11.1e\n", n,
           std::hypot(std::hypot(y[0] - 1, y[1]), std::hypot(y[2], y[3])),
           std::hypot(y[0], y[1]) - 1, (y[2] * y[2] + y[3] * y[3]) / 2 + y[1]);
  }
  long steps;
  IDAGetNumSteps(ida_mem, &steps);
  printf("%ld steps\n", steps);

  IDAFree(&ida_mem);
  SUNLinSolFree(LS);
  SUNMatDestroy(A);
  N_VDestroy(yy);
  N_VDestroy(yp);
  SUNContext_Free(&ctx);
  return 0;
}

static int pendulum(sunrealtype, N_Vector yy, N_Vector yp, N_Vector rr, void*) {
  const sunrealtype *y = N_VGetArrayPointer(yy), *dy = N_VGetArrayPointer(yp);
  sunrealtype* r = N_VGetArrayPointer(rr);
  r[0] = dy[0] - y[2];
  r[1] = dy[1] - y[3];
  r[2] = dy[2] + y[0] * y[4];
  r[3] = dy[3] + y[1] * y[4] + 1;
  r[4] = y[2] * y[2] + y[3] * y[3] - y[1] - y[4];
  return 0;
}

static int check(int flag, const char* name) {
  if (flag < 0) fprintf(stderr, "%s returned %d\n", name, flag);
  return flag < 0;
}

static tether::ida_projection::Constraints constraints() {
  tether::ida_projection::Constraints c;
  c.count = 3;
  c.names = {"length", "velocity", "energy"};
  c.value = [](double, auto y, auto g) {
    g[0] = (y[0] * y[0] + y[1] * y[1] - 1) / 2;
    g[1] = y[0] * y[2] + y[1] * y[3];
    g[2] = (y[2] * y[2] + y[3] * y[3]) / 2 + y[1];
  };
  c.jacobian = tether::ida_projection::DenseJacobian([](double, auto y, auto C) {
    C.row(0) << y[0], y[1], 0, 0, 0;
    C.row(1) << y[2], y[3], y[0], y[1], 0;
    C.row(2) << 0, 1, y[2], y[3], 0;
  });
  return c;
}
