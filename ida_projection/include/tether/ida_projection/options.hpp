// Tether: constraint projection for SUNDIALS IDA. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <sundials/sundials_nonlinearsolver.h>
#include <sundials/sundials_nvector.h>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// The metric D in which the move is shortest: min sum_i (dy_i / D_i)^2 subject to C dy = g.
enum class Metric {
  /// D_i = max(s_i, 1e-3 WT_i), where s_i <- max(0.8 s_i, |correction_i|) follows the size of the
  /// corrector's own change of component i and WT_i = rtol |y_i| + atol_i. A minimum-variance
  /// update: what the corrector changes most absorbs the repair.
  local_correction,
  /// D_i = WT_i, the weights of the error test (Hanson and Krogh).
  error_weights,
  /// local_correction, but error_weights where the linear solver is iterative and the rows are
  /// Gradients or at most a 16th of the unknowns, as the invariants of a field. There s has a kink
  /// wherever the correction changes its sign along a grid. The move then has rough parts, which
  /// take a Krylov method the most iterations. With a direct solver and more than 16 rows: one
  /// scale for all unknowns of a kind (positions, velocities), as Options::group has it, where the
  /// response of stiff components to such moves is smaller.
  automatic,
};

/// The consequence of a move that is longer than Advanced::largest_move allows.
enum class LongMove {
  reject,  ///< recoverable failure: IDA retries with a smaller step
  cap,     ///< scale the move down to the allowed length, as DASSLX does; a failure as above if the
           ///< distance left exceeds both one tolerance and that left by the step before
};

/// The parts of y that the polish, a Newton iteration on F beside the move, changes.
enum class Polished {
  all,           ///< algebraic variables respond to the move; noise that IDA's test left is removed
  differential,  ///< the second alone
  none,          ///< no F is evaluated for it
};

/// One report of the progress callback.
struct Progress {
  double t = 0.0;      ///< time of the step that was just corrected
  double step = 0.0;   ///< step size of that attempt
  int order = 0;       ///< BDF order of that attempt
  double drift = 0.0;  ///< largest |g| that the corrector left
  double move = 0.0;   ///< length of the projection's move, in tolerances (WRMS)
  long steps = 0;      ///< accepted steps so far
};

/// Settings that few programs need. "Tolerances" are units of the error test: the WRMS norm
/// sqrt(sum (dy_i / WT_i)^2 / N) with WT_i = rtol |y_i| + atol_i, in which IDA accepts about 1.
struct Advanced {
  Metric metric = Metric::automatic;  ///< in which the move is shortest

  /// Estimated distance left to the constraints is at most this many tolerances; > 0.
  double tolerance = 1e-4;

  /// Newton moves at most in one step; >= 1. Quadratic convergence takes three; eight reach
  /// `tolerance` from one tolerance where each is a fourth of the one before.
  int maximum_iterations = 8;

  /// Allowed length of a move: largest_move * max(1, length of the corrector's change), in
  /// tolerances; >= 0.1.
  double largest_move = 10.0;
  LongMove long_move = LongMove::reject;  ///< what becomes of a longer one

  /// One F and one back substitution with IDA's own factors; skipped in steps where IDA itself made
  /// two iterations, unless there are algebraic variables and the move was longer than a tenth of a
  /// tolerance.
  Polished polish = Polished::all;

  /// Begin Options::step_smoothing during the run where IDA's own rule is known to harm: F is not
  /// of index 1 in its own variables, or ten steps in a row had a failed error test. The index is
  /// tested once, in serial vectors; above 200 unknowns by equations of F that contain neither y'
  /// nor algebraic variables. IDASetMaxStep is not used then.
  bool smooth_where_needed = true;
  /// The longest step for step_smoothing, which owns IDASetMaxStep; 0: none.
  double maximum_step = 0.0;
  int maximum_order = 5;  ///< the order given to IDASetMaxOrd, for step_smoothing

  /// Limit the order to 2 where higher orders excite fast oscillations that would otherwise stay
  /// below the tolerance, as recognised from the differences of y (docs/method/projection.md,
  /// section 8); not while step sizes are smoothed. Uses IDASetMaxOrd and
  /// IDASetEtaFixedStepBounds, and multiplies the error weights in the three steps that lower the
  /// order.
  bool limit_order = true;

  /// Options::hold for vectors of any kind: 1 free, 0 held. Copied at attach where contiguous.
  N_Vector hold_vector = nullptr;
};

/// Settings of the projection.
struct Options {
  /// IDA's id vector: 1 differential, 0 algebraic. Copied at attach. Null: derived at the first
  /// step from the columns of dF/dy' that are exactly zero (contiguous vectors). That takes about 2
  /// log2(N) evaluations of F for each derivative in an equation, 8000 at most.
  /// Projection::message() tells when it cannot be derived.
  N_Vector id = nullptr;

  /// Keep algebraic variables of index 2 or more, as multipliers, out of IDA's error test: that of
  /// the differential ones controls what they do. Statistics::untested counts them. Their values
  /// between steps have no tolerance; false keeps it. Variables of index 1 stay in the test; the
  /// tolerance of those that differential variables depend on grows by what moves change them by
  /// (IDAGetErrWeights shows it). By IDASetId and IDASetSuppressAlg; IDAReInit takes them back
  /// where `id` is derived. On other than serial vectors F cannot be asked which are which: call
  /// IDASetSuppressAlg for forms of index 2 there.
  bool suppress_algebraic = true;

  /// Choose step sizes with Soederlind's filter H211b instead of IDA's rule "keep h until it can be
  /// doubled": end errors and step counts then vary smoothly with the tolerance. Error estimates
  /// are steered to a quarter of what the error test allows (docs/method/projection.md). Owns IDA's
  /// IDASetEta... settings and IDASetMaxStep.
  bool step_smoothing = false;

  /// Components that a move must not change: true = held. Empty, or one entry for each unknown
  /// (serial vectors; see Advanced::hold_vector for others).
  std::vector<bool> hold;

  /// Groups of components that share one scale in Metric::local_correction (rms over the group,
  /// in tolerances): group[i] >= 0 is the group of component i, -1 none. Keeps symmetries, such as
  /// the rotational one of a point's x, y, z. Empty, or one entry for each unknown.
  std::vector<int> group;

  /// The nonlinear solver to decorate; must be of root-finding type. Null: SUNDIALS' Newton
  /// solver, made and owned by the Projection. IDASetNonlinearSolver must not be called by the
  /// host afterwards.
  SUNNonlinearSolver nonlinear_solver = nullptr;

  /// Print to stderr, once each: the message of a failure that ends the run, and the cause found
  /// where IDA rejects most steps, or one step repeatedly, or results are doubtful.
  bool print = true;

  /// Called after every accepted step; must not throw.
  std::function<void(const Progress&)> progress;

  Advanced advanced;  ///< settings that few programs need
};

}  // namespace tether::ida_projection
TETHER_EXPORT_END
