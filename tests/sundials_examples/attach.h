/* Included before everything else in a SUNDIALS example: IDAInit becomes IDAInit plus attaching. A
 * nonlinear solver that the example brings is handed over to the plugin, which decorates it.
 * SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETHER_TESTS_ATTACH_H
#define TETHER_TESTS_ATTACH_H

#include TETHER_HOST_HEADER

int tether_init_and_attach(void* ida_mem, IDAResFn res, sunrealtype t0, N_Vector yy0, N_Vector yp0);
int tether_attach_with_solver(void* ida_mem, SUNNonlinearSolver solver);

/* Adjoint problems come from IDAInitB, which stays as it is. */
#define IDAInit tether_init_and_attach
#define IDASetNonlinearSolver tether_attach_with_solver

#endif
