/* Included before everything else in a SUNDIALS example: IDAInit becomes IDAInit plus attaching.
 * SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETHER_TESTS_ATTACH_H
#define TETHER_TESTS_ATTACH_H

#include TETHER_HOST_HEADER

int tether_init_and_attach(void* ida_mem, IDAResFn res, sunrealtype t0, N_Vector yy0, N_Vector yp0);

/* Adjoint problems come from IDAInitB, which stays as it is. */
#define IDAInit tether_init_and_attach

#endif
