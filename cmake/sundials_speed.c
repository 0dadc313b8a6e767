/* Prints how many times as long as a compiler's loop SUNDIALS takes for z = a x + b y, see
 * TetherSundialsSpeed.cmake. SPDX-License-Identifier: BSD-3-Clause */
#define _POSIX_C_SOURCE 199309L
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>
#include <time.h>

enum { LENGTH = 1000, TURNS = 2000 };

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void sum(double a, const double* x, double b, const double* y, double* z) {
  for (int i = 0; i < LENGTH; ++i) z[i] = a * x[i] + b * y[i];
}

int main(void) {
  void (*volatile ours)(double, const double*, double, const double*, double*) = sum;
  double least[2] = {1e9, 1e9};
  SUNContext context = NULL;
#ifdef SUN_COMM_NULL
  SUNContext_Create(SUN_COMM_NULL, &context);
#else
  SUNContext_Create(NULL, &context);
#endif
  N_Vector x = N_VNew_Serial(LENGTH, context), y = N_VNew_Serial(LENGTH, context),
           z = N_VNew_Serial(LENGTH, context);
  if (!x || !y || !z) return 1;
  N_VConst(0.5, x);
  N_VConst(0.25, y);
  for (int turn = 0; turn < TURNS; ++turn) {
    const double start = now();
    N_VLinearSum(0.3, x, 0.7, y, z);
    const double middle = now();
    ours(0.3, NV_DATA_S(x), 0.7, NV_DATA_S(y), NV_DATA_S(z));
    const double end = now();
    if (middle - start < least[0]) least[0] = middle - start;
    if (end - middle < least[1]) least[1] = end - middle;
  }
  printf("ratio %.2f\n", least[0] / least[1]);
  N_VDestroy(x);
  N_VDestroy(y);
  N_VDestroy(z);
  SUNContext_Free(&context);
  return 0;
}
