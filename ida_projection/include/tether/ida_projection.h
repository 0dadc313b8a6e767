/* Tether: constraint projection for SUNDIALS IDA, for programs in C. SPDX-License-Identifier:
 * BSD-3-Clause */
#ifndef TETHER_IDA_PROJECTION_H
#define TETHER_IDA_PROJECTION_H

#include <ida/ida.h>
#include <stddef.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <sundials/sundials_nonlinearsolver.h>
#include <sundials/sundials_nvector.h>
#include <sundials/sundials_types.h>
#include <tether/ida_projection/sundials_build.h>

#ifdef __cplusplus
extern "C" {
#endif
#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/** @file
 * The same projection as in <tether/ida_projection.hpp>, whose comments describe every option and
 * every number in full. No exception leaves a function. Functions that return int return
 *
 *   0    success
 *   > 0  a tether_status other than TETHER_SUCCESS: nothing was changed, the message says why
 *   < 0  an error below, or a negative tether_status
 *
 * and tether_last_error() explains the last error of the calling thread. */
enum {
  TETHER_MEM_NULL = -20,      /**< a null pointer where an object is needed, as IDA_MEM_NULL */
  TETHER_MEM_FAIL = -21,      /**< no memory, as IDA_MEM_FAIL */
  TETHER_ILL_INPUT = -22,     /**< an argument out of range; the error names it */
  TETHER_WRONG_SUNDIALS = -30 /**< the SUNDIALS that runs is not the one of the library */
};

/** Outcome of the last action of the plugin. Negative values end the run. */
typedef enum {
  TETHER_UNUSED = 0,           /**< attached, IDA has not called yet */
  TETHER_SUCCESS,              /**< the point lies on the constraints */
  TETHER_NOT_CONVERGED,        /**< moves did not shrink, or too many of them */
  TETHER_MOVE_TOO_LONG,        /**< longer than largest_move allows */
  TETHER_INCONSISTENT,         /**< rows contradict each other */
  TETHER_NOT_FINITE,           /**< NaN or infinity in g, C or y */
  TETHER_CALLBACK_RECOVERABLE, /**< a callback returned > 0 */
  TETHER_CORRECTOR_FAILED,     /**< the decorated solver failed */
  TETHER_COLLAPSED,            /**< IDA rejects most steps; the message tells why */
  TETHER_DOUBTFUL,             /**< F does not keep a row, C is wrong, or atol is too large */
  TETHER_CALLBACK_FATAL = -1,  /**< a callback returned < 0 */
  TETHER_LATE_ATTACH = -2,     /**< attached after IDA was initialised: call IDAReInit */
  TETHER_SIMULTANEOUS_SENSITIVITIES = -3, /**< use IDA_STAGGERED */
  TETHER_NEVER_CALLED = -4,               /**< another nonlinear solver was attached later */
  TETHER_INTERNAL_ERROR = -5,             /**< the message tells why */
  TETHER_OUT_OF_MEMORY = -6,              /**< inside IDA's call; IDAReInit starts anew */
  TETHER_MISUSED = -7 /**< a call that cannot be answered; the message tells why */
} tether_status;

/** Text of the last error in this thread; "" if there was none. Valid until the next call. */
const char* tether_last_error(void);
/** The name of a tether_status. */
const char* tether_status_name(int status);

/* ---- constraints g(t, y) = 0 ---- */

/** A set of rows g_i(t, y) = 0. */
typedef struct tether_constraints tether_constraints;

/** Callbacks return 0 for success, > 0 where g has no value (IDA retries with a smaller step), < 0
 * to end the run. y has N entries, g has `count`. */
typedef int (*tether_value_fn)(sunrealtype t, const sunrealtype* y, sunrealtype* g,
                               void* user_data);
/** C = dg/dy, count x N, row by row: C[i * N + j] = dg_i/dy_j; zero on entry. */
typedef int (*tether_jacobian_fn)(sunrealtype t, const sunrealtype* y, sunrealtype* C,
                                  void* user_data);
/** The entries of a sparse C in the order of its pattern; zero on entry. */
typedef int (*tether_entries_fn)(sunrealtype t, const sunrealtype* y, sunrealtype* entries,
                                 void* user_data);
/** Both in one call, where they share work: g, and C (or its entries), zero on entry. */
typedef int (*tether_value_and_jacobian_fn)(sunrealtype t, const sunrealtype* y, sunrealtype* g,
                                            sunrealtype* C, void* user_data);
/** For vectors of any type: g with the same numbers on every process. */
typedef int (*tether_vector_value_fn)(sunrealtype t, N_Vector y, sunrealtype* g, void* user_data);
/** The gradients that belong to a tether_vector_value_fn: `count` vectors like y. */
typedef int (*tether_gradients_fn)(sunrealtype t, N_Vector y, N_Vector* gradients, void* user_data);

/** An empty set; null without memory. Free it at any time after the projection was created. */
tether_constraints* tether_constraints_new(void);
/** null is allowed. */
void tether_constraints_free(tether_constraints* constraints);

/* Each call adds rows behind those of the calls before it. */

/** `count` rows; jacobian null: C by forward differences. */
int tether_add_rows(tether_constraints* constraints, int count, tether_value_fn value,
                    tether_jacobian_fn jacobian, void* user_data);
/** Rows with few entries: entries starts[i] .. starts[i + 1] - 1 belong to row i, ascending in
 * `columns`; the pattern holds for the whole run. starts has count + 1 entries; both are copied. */
int tether_add_sparse_rows(tether_constraints* constraints, int count, const int* starts,
                           const int* columns, tether_value_fn value, tether_entries_fn entries,
                           void* user_data);
/** g and C of the rows that the last call of one of these two added, together: used wherever both
 * are needed at one point, beside the functions for one of them. C null there: refused. */
int tether_add_value_and_jacobian(tether_constraints* constraints,
                                  tether_value_and_jacobian_fn both, void* user_data);
/** Rows on vectors of any type; a set has either these or the others. */
int tether_add_gradients(tether_constraints* constraints, int count, tether_vector_value_fn value,
                         tether_gradients_fn gradients, void* user_data);
/** (|q|^2 - 1)/2 = 0 for q = y[first .. first + 3]. */
int tether_add_quaternion_norm(tether_constraints* constraints, int first);
/** sum_j coefficients[j] y[j] = value; `length` = N coefficients, copied. */
int tether_add_linear_invariant(tether_constraints* constraints, const sunrealtype* coefficients,
                                long length, sunrealtype value);

/** Name of a row (from 0 over the whole set), for messages; copied. */
int tether_name_row(tether_constraints* constraints, int row, const char* name);
/** Rows so far; TETHER_MEM_NULL for a null pointer. */
int tether_count_rows(const tether_constraints* constraints);

/* ---- options ---- */

/** Values of tether_options::metric, as tether::ida_projection::Metric. */
enum { TETHER_METRIC_LOCAL_CORRECTION, TETHER_METRIC_ERROR_WEIGHTS, TETHER_METRIC_AUTOMATIC };
/** Values of tether_options::long_move, as tether::ida_projection::LongMove. */
enum { TETHER_LONG_MOVE_REJECT, TETHER_LONG_MOVE_CAP };
/** Values of tether_options::polish, as tether::ida_projection::Polished. */
enum { TETHER_POLISH_ALL, TETHER_POLISH_DIFFERENTIAL, TETHER_POLISH_NONE };

/** Called after every accepted step: its time, step size and BDF order, the largest |g| that the
 * corrector left, the length of the move in tolerances, and the number of steps so far. */
typedef void (*tether_progress_fn)(sunrealtype t, sunrealtype step, int order, sunrealtype drift,
                                   sunrealtype move, long steps, void* user_data);

/** Fields as in tether::ida_projection::Options and Advanced; flags are 0 or 1. New fields come at
 * the end. */
typedef struct {
  size_t size;              /**< sizeof(tether_options), by tether_options_init */
  int metric;               /**< TETHER_METRIC_... */
  sunrealtype tolerance;    /**< of the distance to the constraints, in tolerances; > 0 */
  int maximum_iterations;   /**< Newton moves in one step; >= 1 */
  sunrealtype largest_move; /**< in tolerances; >= 0.1 */
  int long_move;            /**< TETHER_LONG_MOVE_... */
  N_Vector id;              /**< 1 differential, 0 algebraic; null: derived. Copied. */
  int suppress_algebraic;   /**< multipliers are left out of IDA's error test */
  int polish;               /**< TETHER_POLISH_... */
  int step_smoothing, smooth_where_needed; /**< filtered step sizes: always; where IDA's harm */
  sunrealtype maximum_step;                /**< with them; 0: none */
  int maximum_order;                       /**< with them; 1 .. 5 */
  int limit_order;      /**< order 2 where higher ones excite fast oscillations */
  const int* hold;      /**< 1: component is not moved; N entries, or null. Copied. */
  N_Vector hold_vector; /**< the same for any vector, but 1 free, 0 held; or null. Copied. */
  const int* group;     /**< group of each component, -1: none; N entries, or null. Copied. */
  SUNNonlinearSolver nonlinear_solver; /**< to decorate; null: SUNDIALS' Newton solver */
  int print;                           /**< messages to stderr */
  tether_progress_fn progress;         /**< or null */
  void* progress_data;                 /**< last argument of `progress` */
} tether_options;

/** Sets the defaults: tether_options options; tether_options_init(&options, sizeof options); */
int tether_options_init(tether_options* options, size_t size);

/* ---- projection ---- */

/** Constraints attached to one IDA. */
typedef struct tether_projection tether_projection;

/** Attaches the constraints to IDA, after IDAInit and before IDACalcIC and the first IDASolve.
 * options null: the defaults; `unknowns`: N, read only where options->hold or group is given. null
 * on failure (IDA is as it was), with the reason in *flag (may be null) and tether_last_error().
 * Free it after IDAFree, or after the last IDASolve. */
tether_projection* tether_projection_new_for(void* ida_mem, const tether_constraints* constraints,
                                             const tether_options* options, long unknowns,
                                             const tether_sundials_build* host, int* flag);
/** A function of the host: so that a library for another SUNDIALS does not link. */
static inline tether_projection* tether_projection_new(void* ida_mem,
                                                       const tether_constraints* constraints,
                                                       const tether_options* options, long unknowns,
                                                       int* flag) {
  return tether_projection_new_for(ida_mem, constraints, options, unknowns, &TETHER_SUNDIALS_BUILD,
                                   flag);
}
/** null is allowed. */
void tether_projection_free(tether_projection* projection);

/** Outcome of tether_make_consistent and tether_project. */
typedef struct {
  size_t size;                           /**< sizeof(tether_report), set by the caller */
  int status;                            /**< a tether_status */
  int iterations;                        /**< Gauss-Newton steps */
  sunrealtype move;                      /**< length of the change of y, in tolerances (WRMS) */
  sunrealtype largest_change;            /**< largest |change| of a component of y */
  int changed_component;                 /**< which one (serial vectors), else -1 */
  sunrealtype derivative_change;         /**< largest |change| of a component of y' */
  sunrealtype drift_before, drift_after; /**< largest |g_i| */
  sunrealtype residual_before, residual_after; /**< largest |F_i|; -1: not known */
  int rank;                                    /**< of C at the end */
  int slow_convergence; /**< 1: gradients vanish on the set, |g| says little about distance */
} tether_report;

/** Initial values onto the constraints, then y' and the algebraic variables consistent with F; IDA
 * restarts there. F (may be null) serves for least squares where IDACalcIC fails. report may be
 * null. On failure yy and yp are unchanged and tether_last_error() says why. */
int tether_make_consistent(tether_projection* projection, sunrealtype t0, N_Vector yy, N_Vector yp,
                           IDAResFn F, void* user_data, tether_report* report);
/** A point between steps onto the constraints, yp (may be null) onto their tangent. */
int tether_project(tether_projection* projection, sunrealtype t, N_Vector yy, N_Vector yp,
                   tether_report* report);
/** IDASolve, then tether_project of what it returns. Returns IDASolve's flag. */
int tether_solve(tether_projection* projection, sunrealtype tout, sunrealtype* tret, N_Vector yret,
                 N_Vector ypret, int itask);

/* ---- sensitivities of IDAS ---- */

/** dg/dp_k for parameter k, as many values as there are rows; zero on entry. */
typedef int (*tether_parameter_fn)(sunrealtype t, const sunrealtype* y, int k, sunrealtype* g_p,
                                   void* user_data);
/** The same for rows added by tether_add_gradients. */
typedef int (*tether_vector_parameter_fn)(sunrealtype t, N_Vector y, int k, sunrealtype* g_p,
                                          void* user_data);

/** As tether::ida_projection::Sensitivities: a function, or parameters for differences of g, or
 * neither, where g does not depend on p. Set what is not used to 0. */
typedef struct {
  size_t size;                                  /**< sizeof(tether_sensitivities) */
  int count;                                    /**< Ns of IDASensInit */
  tether_parameter_fn derivative;               /**< dg/dp_k, or null */
  tether_vector_parameter_fn vector_derivative; /**< the same for gradients, or null */
  void* user_data;                              /**< last argument of the function */
  sunrealtype* parameters;                      /**< p, which g reads, for differences; or null */
  const sunrealtype* scales;                    /**< pbar, count entries, or null; copied */
  const int* list;                              /**< plist, count entries, or null; copied */
  SUNNonlinearSolver nonlinear_solver;          /**< of the staggered corrector; null: Newton */
} tether_sensitivities;

/** After IDASensInit with IDA_STAGGERED: from now on the sensitivities of each step are moved onto
 * C s + dg/dp = 0. */
int tether_project_sensitivities(tether_projection* projection,
                                 const tether_sensitivities* sensitivities);
/** Initial sensitivities onto C s + dg/dp = 0, sp (may be null) onto its derivative; hand them to
 * IDASensReInit. On failure s and sp are unchanged. */
int tether_make_sensitivities_consistent(tether_projection* projection, sunrealtype t0, N_Vector yy,
                                         N_Vector yp, N_Vector* s, N_Vector* sp,
                                         tether_report* report);

/** For adjoint problems: v <- v - C^T (C C^T)^+ C v, the gradient of a function of y without its
 * part across the constraints. */
int tether_project_gradient(tether_projection* projection, sunrealtype t, N_Vector yy, N_Vector v);

/** The status of the last step or call; TETHER_MEM_NULL for a null pointer. */
int tether_get_status(const tether_projection* projection);
/** The message, with advice; "" when all is well. Valid until the next call with this projection.
 */
const char* tether_get_message(const tether_projection* projection);
/** A number of tether::ida_projection::Statistics by the name of its field, e.g. "projections". */
int tether_get_statistic(const tether_projection* projection, const char* name, double* value);
/** A verdict of one line, and those that are not zero, one a line. Valid until the next call with
 * this projection; null without memory. */
const char* tether_get_statistics_table(const tether_projection* projection);
/** Sets all of them to 0. */
int tether_reset_statistics(tether_projection* projection);

/* ---- faster vectors and dense solver for small systems ---- */

/** Makes the operations of a serial vector faster; its results keep their bits. Like
 * tether_fast_dense_solver, it needs no projection; see <tether/ida_projection/fast.hpp>. */
int tether_fast_vector(N_Vector y);
/** SUNLinSol_Dense with its bits, but faster, for up to 64 rows. null on failure: see
 * tether_last_error(). */
SUNLinearSolver tether_fast_dense_solver(N_Vector y, SUNMatrix A);

#ifdef __cplusplus
}
#endif
#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
#endif
