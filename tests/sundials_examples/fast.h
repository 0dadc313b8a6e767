/* Included before everything else in a SUNDIALS example: IDAInit and IDAInitB make their vectors
 * fast first, and SUNLinSol_Dense is the fast solver where the matrix is small enough.
 * SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETHER_TESTS_FAST_H
#define TETHER_TESTS_FAST_H

#include TETHER_HOST_HEADER
#include <sunlinsol/sunlinsol_dense.h>

int tether_init_fast(void* ida_mem, IDAResFn res, sunrealtype t0, N_Vector yy0, N_Vector yp0);
SUNLinearSolver tether_fast_dense(N_Vector y, SUNMatrix A, SUNContext context);

#define IDAInit tether_init_fast
#define SUNLinSol_Dense tether_fast_dense
#ifdef IDA_STAGGERED /* IDAS */
int tether_init_fast_backwards(void* ida_mem, int which, IDAResFnB res, sunrealtype t0,
                               N_Vector yy0, N_Vector yp0);
#define IDAInitB tether_init_fast_backwards
#endif

#endif
