/* Tether: the functions of SUNDIALS IDAS that the plugin needs, brought by its host, for C and C++.
 * SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETHER_IDAS_FUNCTIONS_H
#define TETHER_IDAS_FUNCTIONS_H

#include <sundials/sundials_nonlinearsolver.h>
#include <sundials/sundials_nvector.h>
#include <sundials/sundials_types.h>

#ifdef __cplusplus
extern "C" {
#endif

/** @file
 * As in <idas/idas.h>, which repeats typedefs of <ida/ida.h> and so is not included beside it. */

/** A function of IDAS. */
int IDASetNonlinearSolverSensStg(void* ida_mem, SUNNonlinearSolver NLS);
/** A function of IDAS. */
int IDAGetNonlinearSystemDataSens(void* ida_mem, sunrealtype* tcur, N_Vector** yySpred,
                                  N_Vector** ypSpred, N_Vector** yySn, N_Vector** ypSn,
                                  sunrealtype* cj, void** user_data);
/** A function of IDAS. */
int IDAGetSensNumLinSolvSetups(void* ida_mem, long int* nlinsetupsS);

/** The library links neither IDA nor IDAS (same symbols, other memory layouts), and a host with IDA
 * has none of these. */
typedef struct {
  int (*set_solver)(void*, SUNNonlinearSolver); /**< IDASetNonlinearSolverSensStg */
  /** IDAGetNonlinearSystemDataSens */
  int (*system_data)(void*, sunrealtype*, N_Vector**, N_Vector**, N_Vector**, N_Vector**,
                     sunrealtype*, void**);
  int (*setups)(void*, long int*); /**< IDAGetSensNumLinSolvSetups */
} tether_idas_functions;

/** Compiled into the host, and only where it is called. */
static inline tether_idas_functions tether_idas_of_host(void) {
  tether_idas_functions f;
  f.set_solver = IDASetNonlinearSolverSensStg;
  f.system_data = IDAGetNonlinearSystemDataSens;
  f.setups = IDAGetSensNumLinSolvSetups;
  return f;
}

#ifdef __cplusplus
}
#endif
#endif
