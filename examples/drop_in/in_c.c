/* Tether: after.cpp in C. SPDX-License-Identifier: BSD-3-Clause
 *
 * Unknowns x, y, vx, vy and the tension lambda; L = g = m = 1. The pendulum starts horizontally at
 * rest; length, velocity and energy are kept. Exit code 1 if they are not. */
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection.h>

#define NEQ 5
#define PERIOD 7.4162987092054876737354013887173 /* 4 K(1/2) */
#define NPERIODS 100

static int pendulum(sunrealtype t, N_Vector yy, N_Vector yp, N_Vector rr, void* user_data) {
  const sunrealtype *y = N_VGetArrayPointer(yy), *dy = N_VGetArrayPointer(yp);
  sunrealtype* r = N_VGetArrayPointer(rr);
  (void)t, (void)user_data;
  r[0] = dy[0] - y[2];
  r[1] = dy[1] - y[3];
  r[2] = dy[2] + y[0] * y[4];
  r[3] = dy[3] + y[1] * y[4] + 1;
  r[4] = y[2] * y[2] + y[3] * y[3] - y[1] - y[4];
  return 0;
}

static int rows(sunrealtype t, const sunrealtype* y, sunrealtype* g, void* user_data) {
  (void)t, (void)user_data;
  g[0] = (y[0] * y[0] + y[1] * y[1] - 1) / 2;
  g[1] = y[0] * y[2] + y[1] * y[3];
  g[2] = (y[2] * y[2] + y[3] * y[3]) / 2 + y[1];
  return 0;
}

static int jacobian(sunrealtype t, const sunrealtype* y, sunrealtype* C, void* user_data) {
  (void)t, (void)user_data;
  C[0 * NEQ + 0] = y[0], C[0 * NEQ + 1] = y[1];
  C[1 * NEQ + 0] = y[2], C[1 * NEQ + 1] = y[3], C[1 * NEQ + 2] = y[0], C[1 * NEQ + 3] = y[1];
  C[2 * NEQ + 1] = 1, C[2 * NEQ + 2] = y[2], C[2 * NEQ + 3] = y[3];
  return 0;
}

static int check(int flag, const char* name) {
  if (flag < 0) fprintf(stderr, "%s returned %d: %s\n", name, flag, tether_last_error());
  return flag < 0;
}

int main(void) {
  SUNContext ctx;
  N_Vector yy, yp;
  SUNMatrix A;
  SUNLinearSolver LS;
  void* ida_mem;
  tether_constraints* constraints = tether_constraints_new();
  tether_projection* projection;
  sunrealtype *y, t, energy = 0, length = 0;
  double moved = 0;
  int flag, n;

#ifdef SUN_COMM_NULL /* SUNDIALS 7 */
  SUNContext_Create(SUN_COMM_NULL, &ctx);
#else
  SUNContext_Create(NULL, &ctx);
#endif
  yy = N_VNew_Serial(NEQ, ctx);
  yp = N_VNew_Serial(NEQ, ctx);
  N_VConst(0.0, yy);
  N_VConst(0.0, yp);
  y = N_VGetArrayPointer(yy);
  y[0] = 1.0;
  N_VGetArrayPointer(yp)[3] = -1.0;

  ida_mem = IDACreate(ctx);
  if (check(IDAInit(ida_mem, pendulum, 0.0, yy, yp), "IDAInit")) return 1;
  if (check(tether_add_rows(constraints, 3, rows, jacobian, NULL), "tether_add_rows")) return 1;
  tether_name_row(constraints, 2, "energy");
  projection = tether_projection_new(ida_mem, constraints, NULL, NEQ, &flag);
  if (check(flag, "tether_projection_new")) return 1;
  tether_constraints_free(constraints);
  if (check(IDASStolerances(ida_mem, 1e-6, 1e-6), "IDASStolerances")) return 1;
  A = SUNDenseMatrix(NEQ, NEQ, ctx);
  LS = SUNLinSol_Dense(yy, A, ctx);
  if (check(IDASetLinearSolver(ida_mem, LS, A), "IDASetLinearSolver")) return 1;
  if (check(IDASetMaxNumSteps(ida_mem, 1000000), "IDASetMaxNumSteps")) return 1;

  printf("periods  |end - start|   length - 1      energy\n");
  for (n = 1; n <= NPERIODS; n *= 10) {
    if (check(IDASolve(ida_mem, n * PERIOD, &t, yy, yp, IDA_NORMAL), "IDASolve")) return 1;
    /* IDASolve interpolates: the point between steps is put onto the constraints as well. */
    if (tether_project(projection, t, yy, yp, NULL) != 0) {
      fprintf(stderr, "%s\n", tether_get_message(projection));
      return 1;
    }
    length = hypot(y[0], y[1]) - 1;
    energy = (y[2] * y[2] + y[3] * y[3]) / 2 + y[1];
    printf("%7d  %13.1e %12.1e %11.1e\n", n, hypot(hypot(y[0] - 1, y[1]), hypot(y[2], y[3])), length,
           energy);
  }
  if (check(tether_get_statistic(projection, "projections", &moved), "tether_get_statistic"))
    return 1;
  printf("%.0f projections\n", moved);

  IDAFree(&ida_mem);
  tether_projection_free(projection);
  SUNLinSolFree(LS);
  SUNMatDestroy(A);
  N_VDestroy(yy);
  N_VDestroy(yp);
  SUNContext_Free(&ctx);
  return fabs(length) < 1e-9 && fabs(energy) < 1e-9 && moved > 0 ? 0 : 1;
}
