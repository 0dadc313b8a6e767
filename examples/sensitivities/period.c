/* Tether: dT/dL of a pendulum's period by forward sensitivities, plain and projected.
 * SPDX-License-Identifier: BSD-3-Clause
 *
 * T grows with the root of the length L: dT/dL = T/(2 L). The pendulum starts level at rest and is
 * back after T, where x vy - y vx = 0. */
#include <idas/idas.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection.h>

#define Y(v, i) NV_Ith_S(v, i)

static const double gravity = 9.8;
static const double quarter = 1.854074677301371918; /* K(1/2): T = 4 K sqrt(L/g) from level */

/* F(t, y, y') = 0 for y = (x, y, vx, vy, tension/L), index 1. */
static int pendulum(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* user_data) {
  const double L = *(double*)user_data;
  (void)t;
  Y(r, 0) = Y(yp, 0) - Y(y, 2);
  Y(r, 1) = Y(yp, 1) - Y(y, 3);
  Y(r, 2) = Y(yp, 2) + Y(y, 0) * Y(y, 4);
  Y(r, 3) = Y(yp, 3) + Y(y, 1) * Y(y, 4) + gravity;
  Y(r, 4) = Y(y, 2) * Y(y, 2) + Y(y, 3) * Y(y, 3) - gravity * Y(y, 1) - L * L * Y(y, 4);
  return 0;
}

/* F_y s + F_y' s' + F_L. */
static int residuals(int count, sunrealtype t, N_Vector y, N_Vector yp, N_Vector res, N_Vector* s,
                     N_Vector* sp, N_Vector* r, void* user_data, N_Vector w1, N_Vector w2,
                     N_Vector w3) {
  const double L = *(double*)user_data;
  (void)count, (void)t, (void)yp, (void)res, (void)w1, (void)w2, (void)w3;
  Y(r[0], 0) = Y(sp[0], 0) - Y(s[0], 2);
  Y(r[0], 1) = Y(sp[0], 1) - Y(s[0], 3);
  Y(r[0], 2) = Y(sp[0], 2) + Y(s[0], 0) * Y(y, 4) + Y(y, 0) * Y(s[0], 4);
  Y(r[0], 3) = Y(sp[0], 3) + Y(s[0], 1) * Y(y, 4) + Y(y, 1) * Y(s[0], 4);
  Y(r[0], 4) = 2 * Y(y, 2) * Y(s[0], 2) + 2 * Y(y, 3) * Y(s[0], 3) - gravity * Y(s[0], 1) -
               L * L * Y(s[0], 4) - 2 * L * Y(y, 4);
  return 0;
}

/* Length, its rate, energy. */
static int rows(sunrealtype t, const sunrealtype* y, sunrealtype* g, void* user_data) {
  const double L = *(double*)user_data;
  (void)t;
  g[0] = (y[0] * y[0] + y[1] * y[1] - L * L) / 2;
  g[1] = y[0] * y[2] + y[1] * y[3];
  g[2] = (y[2] * y[2] + y[3] * y[3]) / 2 + gravity * y[1];
  return 0;
}

static int by_length(sunrealtype t, const sunrealtype* y, int k, sunrealtype* g_p,
                     void* user_data) {
  (void)t, (void)y, (void)k;
  g_p[0] = -*(double*)user_data;
  return 0;
}

/* dT/dL at this tolerance; NaN where the run fails. */
static double derivative(SUNContext context, double tolerance, int projected, long* steps) {
  double L = 1.3, T = 4 * quarter * sqrt(L / gravity), t = 0, result = NAN;
  N_Vector y = N_VNew_Serial(5, context), yp = N_VClone(y), s = N_VClone(y), sp = N_VClone(y);
  SUNMatrix A = SUNDenseMatrix(5, 5, context);
  SUNLinearSolver solver = SUNLinSol_Dense(y, A, context);
  void* ida_mem = IDACreate(context);
  tether_constraints* set = tether_constraints_new();
  tether_projection* projection = NULL;
  int flag = 0;
  N_VConst(0, y), N_VConst(0, yp), N_VConst(0, s), N_VConst(0, sp);
  Y(y, 0) = L;
  Y(yp, 3) = -gravity;
  Y(s, 0) = 1;

  IDAInit(ida_mem, pendulum, 0, y, yp);
  IDASetUserData(ida_mem, &L);
  IDASStolerances(ida_mem, tolerance, tolerance);
  IDASetLinearSolver(ida_mem, solver, A);
  IDASetMaxNumSteps(ida_mem, 100000);
  tether_add_rows(set, 3, rows, NULL, &L);
  if (projected) projection = tether_projection_new(ida_mem, set, NULL, 5, &flag);

  IDASensInit(ida_mem, 1, IDA_STAGGERED, residuals, &s, &sp);
  IDASetSensParams(ida_mem, &L, &L, NULL);
  IDASensEEtolerances(ida_mem);
  IDASetSensErrCon(ida_mem, 1);
  if (projected) { /* the added call */
    tether_sensitivities parameters = {
        sizeof(tether_sensitivities), 1, by_length, NULL, &L, NULL, NULL, NULL, NULL};
    flag = tether_project_sensitivities(projection, &parameters);
    if (flag != 0) printf("%s\n", tether_last_error());
  }
  if (flag == 0) flag = IDASolve(ida_mem, T, &t, y, yp, IDA_NORMAL);
  if (flag >= 0 && IDAGetSens(ida_mem, &t, &s) == 0) {
    const double moves =
        Y(s, 0) * Y(y, 3) + Y(y, 0) * Y(s, 3) - Y(s, 1) * Y(y, 2) - Y(y, 1) * Y(s, 2);
    result = moves / (gravity * Y(y, 0)); /* (x vy - y vx)' = -g x */
  }
  IDAGetNumSteps(ida_mem, steps);
  IDAFree(&ida_mem);
  tether_projection_free(projection);
  tether_constraints_free(set);
  SUNLinSolFree(solver);
  SUNMatDestroy(A);
  N_VDestroy(y), N_VDestroy(yp), N_VDestroy(s), N_VDestroy(sp);
  return result;
}

int main(void) {
  SUNContext context;
  const double expected = 4 * quarter / sqrt(1.3 * gravity) / 2;
  double tolerance, projected = 1;
#if SUNDIALS_VERSION_MAJOR >= 7
  if (SUNContext_Create(SUN_COMM_NULL, &context) != 0) return 1;
#else
  if (SUNContext_Create(NULL, &context) != 0) return 1;
#endif
  printf("error of dT/dL = %.6f s/m\n\ntolerance   plain IDAS   steps    projected   steps\n",
         expected);
  for (tolerance = 1e-4; tolerance > 1e-10; tolerance /= 100) {
    long steps[2] = {0, 0};
    const double plain = fabs(derivative(context, tolerance, 0, &steps[0]) - expected);
    projected = fabs(derivative(context, tolerance, 1, &steps[1]) - expected);
    printf("%9.0e %12.1e %7ld %12.1e %7ld\n", tolerance, plain, steps[0], projected, steps[1]);
  }
  SUNContext_Free(&context);
  return projected < 1e-6 * expected ? 0 : 1;
}
