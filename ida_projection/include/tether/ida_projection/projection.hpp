// Tether: constraint projection for SUNDIALS IDA. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ida/ida.h>
#include <memory>
#include <string>
#include <tether/export.hpp>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <tether/ida_projection/sundials_build.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

struct Sensitivities;  // <tether/ida_projection/sensitivities.hpp>

/// Outcome of the last action of the plugin. Negative values end the run.
enum class Status {
  unused = 0,            ///< attached, IDA has not called yet
  success,               ///< the point lies on the constraints
  not_converged,         ///< moves did not shrink, or too many of them
  move_too_long,         ///< longer than Advanced::largest_move allows
  inconsistent,          ///< rows contradict each other; message names them
  not_finite,            ///< NaN or infinity in g, C or y
  callback_recoverable,  ///< a callback returned > 0
  corrector_failed,      ///< the decorated solver failed; nothing was projected
  collapsed,  ///< the last step was projected, but IDA rejects most steps; message tells why
  doubtful,   ///< the last step was projected, but F does not keep a row, C is wrong, or atol lies
              ///< above the solution; message tells which
  callback_fatal = -1,              ///< a callback returned < 0 or threw
  late_attach = -2,                 ///< attached after IDA was initialised: call IDAReInit
  simultaneous_sensitivities = -3,  ///< IDA_SIMULTANEOUS bypasses the plugin: use IDA_STAGGERED
  never_called = -4,    ///< IDA took steps without the plugin: another solver was attached later
  internal_error = -5,  ///< the library cannot go on; message tells why
  out_of_memory = -6,   ///< memory ran out inside IDA's call; IDAReInit starts anew
  misused = -7,  ///< a call that cannot be answered, which changed nothing; message tells why
};

/// The enumerator as text.
const char* to_string(Status status);

/// How far make_consistent or project moved things.
struct ConsistencyReport {
  Status status = Status::unused;  ///< of the call
  std::string message;             ///< what to do about it; empty when all is well
  int iterations = 0;              ///< Gauss-Newton steps of the projection of y
  double move = 0.0;               ///< length of the change of y, in tolerances (WRMS)
  double largest_change = 0.0;     ///< largest |change| of a component of y
  int changed_component = -1;      ///< which one (serial vectors)
  double derivative_change = 0.0;  ///< largest |change| of a component of y'
  double drift_before = 0.0;       ///< largest |g_i|
  double drift_after = 0.0;        ///< largest |g_i|
  double residual_before = -1.0;   ///< largest |F_i| at the given values; -1 when not known
  double residual_after = -1.0;    ///< largest |F_i| after; -1 when not known
  int rank = 0;                    ///< of C at the end
  bool slow_convergence = false;   ///< gradients vanish on the set: |g| says little about distance
  std::vector<int> contradicting_rows;  ///< rows of g that no point near obeys together

  /// Whether it succeeded.
  explicit operator bool() const { return status == Status::success; }
};

/// How make_consistent finds y'.
struct Consistency {
  /// The method for y'.
  enum class Derivative {
    automatic,      ///< IDACalcIC; if that fails and `residual` is given, least squares
    calc_ic,        ///< IDACalcIC (IDA_YA_YDP_INIT) with the id vector
    least_squares,  ///< Gauss-Newton on (y' differential, y algebraic), serial vectors
    keep,           ///< leave y' as it is
  };
  Derivative derivative = Derivative::automatic;  ///< the method for y'
  /// Time of a first output, as IDACalcIC wants; 0 = t0 + 1e-3 max(1, |t0|).
  double direction = 0.0;
  IDAResFn residual = nullptr;  ///< F, for least squares and for the residuals in the report
  void* user_data = nullptr;    ///< of `residual`
  int maximum_iterations = 30;  ///< of least squares
  std::vector<bool> hold;  ///< components of y to leave as they are (in addition to Options::hold)
};

/// Constraint projection inside IDA: decorates IDA's nonlinear solver, so that every candidate y =
/// ypred + ycor is moved onto g(t, y) = 0 before IDA tests its error and accepts it (Hanson and
/// Krogh). The object must live until IDAFree or the last IDASolve, whichever is first; IDASolve
/// without it fails (IDA_NLS_FAIL, before the first step IDA_NLS_INIT_FAIL). A nonlinear solver
/// that the host attaches later replaces it silently. status(), message(), statistics(), IDAFree
/// and the destructor therefore compare IDA's steps with the calls that the plugin has had. A
/// difference is printed once to stderr (Options::print). One that was moved from throws
/// std::logic_error.
///
/// One call to add, after IDAInit and before IDACalcIC and the first IDASolve:
///
///     tether::ida_projection::Projection projection(ida_mem, constraints);
class [[nodiscard]] Projection {
 public:
  /// ida_mem: from IDACreate, after IDAInit; tolerances and linear solver may come later.
  /// Throws std::invalid_argument, naming the argument and its value, and std::runtime_error if the
  /// SUNDIALS that runs is not the one that the library was compiled with, std::bad_alloc without
  /// memory; leaves IDA as it was.
  [[nodiscard]] Projection(void* ida_mem, Constraints constraints, Options options = {})
      : Projection(ida_mem, std::move(constraints), std::move(options), TETHER_SUNDIALS_BUILD) {}
  ~Projection();
  Projection(Projection&&) noexcept;
  Projection& operator=(Projection&&) noexcept;
  Projection(const Projection&) = delete;
  Projection& operator=(const Projection&) = delete;

  /// Initial values onto the constraints, then y' (and the algebraic variables) consistent with F.
  /// Damped Gauss-Newton in the error weights. Restarts IDA (IDAReInit) at the result. On failure
  /// yy and yp are unchanged. Call it after tolerances and linear solver are set.
  ConsistencyReport make_consistent(double t0, N_Vector yy, N_Vector yp,
                                    const Consistency& how = {});

  /// A point between steps (interpolated output, a root, a restart) onto the constraints; yp (may
  /// be null) onto their tangent C y' + g_t = 0. On failure both are unchanged.
  ConsistencyReport project(double t, N_Vector yy, N_Vector yp = nullptr);

  /// IDASolve, then project() of what it returns. Returns IDASolve's flag; a failed projection of
  /// the returned point leaves that point as IDA gave it and shows in status().
  int solve(double tout, double* tret, N_Vector yret, N_Vector ypret, int itask);

  /// See <tether/ida_projection/sensitivities.hpp>, whose function of this name is to be called.
  void project_sensitivities(Sensitivities sensitivities);

  /// Initial sensitivities (as many as Sensitivities::count, after project_sensitivities) onto C
  /// s_k + dg/dp_k = 0. Likewise sp (may be null) onto the derivative of that along (y, y'), each
  /// by its shortest change in the error weights. Hand the result to IDASensReInit; IDACalcIC may
  /// follow. y, y' on the constraints. On failure s and sp are unchanged.
  ConsistencyReport make_sensitivities_consistent(double t0, N_Vector yy, N_Vector yp, N_Vector* s,
                                                  N_Vector* sp);

  /// For adjoint problems: the gradient of a function of y, without its part across the
  /// constraints. v <- v - C^T (C C^T)^+ C v with C at (t, y). On failure v is unchanged. Needs no
  /// sensitivities; std::invalid_argument for a UserProjection.
  ConsistencyReport project_gradient(double t, N_Vector yy, N_Vector v);

  Statistics statistics() const;       ///< since the start, or the last reset
  void reset_statistics();             ///< all to 0
  Status status() const;               ///< of the last call by IDA, or of the last call above
  const std::string& message() const;  ///< what to do about it; empty when all is well

  class TETHER_HIDDEN Impl;  // the decorator; see src/

 private:
  Projection(void* ida_mem, Constraints constraints, Options options, const SundialsBuild& built);

  std::unique_ptr<Impl> impl_;
};

}  // namespace tether::ida_projection
TETHER_EXPORT_END
