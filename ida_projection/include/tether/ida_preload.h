/* Tether: constraints for programs that cannot be recompiled. SPDX-License-Identifier:
 * BSD-3-Clause */
#ifndef TETHER_IDA_PRELOAD_H
#define TETHER_IDA_PRELOAD_H

#include <tether/ida_projection.h>

#ifdef __cplusplus
extern "C" {
#endif
#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/** @file
 * Constraints by LD_PRELOAD. */

/** A shared object of yours defines this, so that libtether_preload attaches constraints to the IDA
 * of a program that links SUNDIALS dynamically:
 *
 *   LD_PRELOAD=libtether_preload.so TETHER_CONSTRAINTS=./mine.so program
 *
 * Called once for each IDA object, before its first IDACalcIC or IDASolve. y: a copy of the initial
 * values given to IDAInit. Add rows to `constraints` and set what you like in `options`, which has
 * the defaults (and the program's own nonlinear solver, where it has one). Its tether_add_... come
 * from the preloaded library: link nothing.
 *
 *   0    attach the rows; none: leave this IDA as it is
 *   > 0  leave this IDA as it is
 *   < 0  an error: IDACalcIC and IDASolve return IDA_ILL_INPUT
 *
 * So do rows that cannot be attached; the reason is on standard error. With TETHER_STATISTICS set,
 * IDAFree writes the projection's statistics there. */
int tether_preload(void* ida_mem, N_Vector y, tether_constraints* constraints,
                   tether_options* options);

/* The rest is in libtether_preload, for tether_preload to call, and for modules of a host that has
 * loaded the library by itself (dlopen with RTLD_LAZY | RTLD_GLOBAL, before what links SUNDIALS).
 */

/** Projects points that IDASolve and IDAGetDky return for this IDA, too: interpolated points are
 * off the constraints by a part of the tolerance. IDA's own steps are as without. */
int tether_preload_project_output(void* ida_mem);

/** A function in place of tether_preload(), with its arguments and results. */
typedef int (*tether_preload_fn)(void* ida_mem, N_Vector y, tether_constraints* constraints,
                                 tether_options* options);
/** Asked in place of the object that TETHER_CONSTRAINTS names; null: that one again. */
void tether_preload_ask(tether_preload_fn ask);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
#ifdef __cplusplus
}
#endif
#endif
