/* Tether: IDA by reverse communication, for programs in C and Fortran. SPDX-License-Identifier:
 * BSD-3-Clause */
#ifndef TETHER_REVERSE_IDA_H
#define TETHER_REVERSE_IDA_H

#include <tether/ida_projection.h>

#ifdef __cplusplus
extern "C" {
#endif
#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/** @file
 * The same as in <tether/reverse_ida.hpp>, whose comments describe it in full. */

/** IDA on a stack of its own. */
typedef struct tether_reverse tether_reverse;

/** Why a call has returned. From TETHER_ASK_RESIDUAL on: fill the result, call
 * tether_reverse_go_on.
 */
enum {
  TETHER_REACHED,                /**< t, y and yp are the solution that was asked for */
  TETHER_STOPPED,                /**< the integration cannot go on: tether_reverse_message */
  TETHER_ASK_RESIDUAL,           /**< F(t, y, yp), N entries */
  TETHER_ASK_JACOBIAN,           /**< dF/dy + cj dF/dyp, N x N by columns; zero on entry */
  TETHER_ASK_SETUP,              /**< factorise that matrix; no result */
  TETHER_ASK_SOLVE,              /**< x with that matrix times x = rhs */
  TETHER_ASK_CONSTRAINTS,        /**< g(t, y) */
  TETHER_ASK_CONSTRAINT_JACOBIAN /**< dg/dy, m x N by rows; zero on entry */
};

/** Who solves the linear systems: SUNDIALS with differences of F, SUNDIALS with the caller's
 * matrix, or the caller. */
enum { TETHER_LINEAR_DIFFERENCES, TETHER_LINEAR_JACOBIAN, TETHER_LINEAR_OWN };

/** IDA for F(t, y, yp) = 0 in n unknowns from (t0, y, yp), which are copied; id: n entries or null;
 * `constraints` rows g(t, y) = 0 (0: plain IDA) with options (null: the defaults). null on failure,
 * with the reason in *flag (may be null) and tether_reverse_last_error(). */
tether_reverse* tether_reverse_new_for(int n, double t0, const double* y, const double* yp,
                                       const double* id, double rtol, double atol, int linear,
                                       int constraints, const tether_options* options,
                                       const tether_sundials_build* host, int* flag);
/** A function of the host: so that a library for another SUNDIALS does not link. */
static inline tether_reverse* tether_reverse_new(int n, double t0, const double* y,
                                                 const double* yp, const double* id, double rtol,
                                                 double atol, int linear, int constraints,
                                                 const tether_options* options, int* flag) {
  return tether_reverse_new_for(n, t0, y, yp, id, rtol, atol, linear, constraints, options,
                                &TETHER_SUNDIALS_BUILD, flag);
}
/** null is allowed; a request that is open is given up. */
void tether_reverse_free(tether_reverse* reverse);

/* Each returns one of the TETHER_REACHED ... above, or an error < 0 (TETHER_ILL_INPUT for a call
 * out of turn: a request is open, or there is none). */

/** Up to tout, or by one step of IDA towards it. */
int tether_reverse_solve(tether_reverse* reverse, double tout, int one_step);
/** Initial values onto the constraints and consistent with F. */
int tether_reverse_make_consistent(tether_reverse* reverse);
/** Goes on after a request. answer: 0 the result is in place, > 0 it has no value here, < 0 end the
 * run. */
int tether_reverse_go_on(tether_reverse* reverse, int answer);

/* The place where IDA stands, or asks. Pointers that a request has no use for are null. */

double tether_reverse_t(const tether_reverse* reverse); /**< time */
/** cj of TETHER_ASK_JACOBIAN and TETHER_ASK_SETUP. */
double tether_reverse_cj(const tether_reverse* reverse);
const double* tether_reverse_y(const tether_reverse* reverse);   /**< N entries */
const double* tether_reverse_yp(const tether_reverse* reverse);  /**< N entries */
const double* tether_reverse_rhs(const tether_reverse* reverse); /**< N entries */
/** Where the result of a request goes; see TETHER_ASK_RESIDUAL and below for its shape. */
double* tether_reverse_result(const tether_reverse* reverse);

/** Why it stopped; "" otherwise. Valid until the next call with this object. */
const char* tether_reverse_message(tether_reverse* reverse);
/** Text of the last error of these functions in this thread. Valid until the next call. */
const char* tether_reverse_last_error(void);
/** IDA's memory, for IDASet... and IDAGet... between calls. */
void* tether_reverse_ida_mem(const tether_reverse* reverse);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
#ifdef __cplusplus
}
#endif
#endif
