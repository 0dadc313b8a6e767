/* Tether: the pendulum's constraints for a program that is not recompiled. SPDX-License-Identifier:
 * BSD-3-Clause
 *
 * LD_PRELOAD=libtether_preload.so TETHER_CONSTRAINTS=./pendulum_rows.so drop_in_before */
#include <tether/ida_preload.h>

/* Of the start, which the run keeps. */
static struct { sunrealtype length_square, energy; } start;

static sunrealtype length_square(const sunrealtype* y) { return y[0] * y[0] + y[1] * y[1]; }
static sunrealtype energy(const sunrealtype* y) { return (y[2] * y[2] + y[3] * y[3]) / 2 + y[1]; }

static int rows(sunrealtype t, const sunrealtype* y, sunrealtype* g, void* user_data) {
  (void)t;
  (void)user_data;
  g[0] = (length_square(y) - start.length_square) / 2;
  g[1] = y[0] * y[2] + y[1] * y[3];
  g[2] = energy(y) - start.energy;
  return 0;
}

static int jacobian(sunrealtype t, const sunrealtype* y, sunrealtype* C, void* user_data) {
  (void)t;
  (void)user_data;
  C[0] = y[0], C[1] = y[1];
  C[5] = y[2], C[6] = y[3], C[7] = y[0], C[8] = y[1];
  C[11] = 1, C[12] = y[2], C[13] = y[3];
  return 0;
}

int tether_preload(void* ida_mem, N_Vector y, tether_constraints* constraints,
                   tether_options* options) {
  (void)ida_mem;
  (void)options;
  if (N_VGetLength(y) != 5) return 1; /* not the pendulum */
  start.length_square = length_square(N_VGetArrayPointer(y));
  start.energy = energy(N_VGetArrayPointer(y));
  return tether_add_rows(constraints, 3, rows, jacobian, NULL);
}
