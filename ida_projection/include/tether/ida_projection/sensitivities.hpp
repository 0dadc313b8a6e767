// Tether: forward sensitivities of SUNDIALS IDAS, kept tangent to the constraints.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/ida_projection/projection.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// From g(t, y, p) = 0 follows C s_k + dg/dp_k = 0 for the sensitivities s_k = dy/dp_k, C = dg/dy.
/// How dg/dp_k is found: by a function, by differences of g in p, or, where neither is given, it is
/// zero.
struct Sensitivities {
  int count = 0;  ///< Ns of IDASensInit

  /// (t, y, k, g_p): dg/dp_k at (t, y) for parameter k = 0 .. count - 1, m values in g's units per
  /// unit of p_k; zero on entry.
  Callable<double, ConstVector, int, Vector> derivative;
  /// The same for rows that are Gradients, with the same numbers on every process.
  Callable<double, N_Vector, int, double*> vector_derivative;

  /// The host's p, which g reads, as in IDASetSensParams: each p_k is changed by up to 2e-3 of its
  /// scale while g is evaluated (four times), and put back. Not used where a function is given.
  double* parameters = nullptr;
  std::vector<double> scales;  ///< pbar, all != 0; empty: |p_k|, or 1 where that is 0
  std::vector<int> list;       ///< plist: p_k is parameters[list[k]]; empty: k

  /// The nonlinear solver of the staggered corrector to decorate, for `count` vectors. Null:
  /// SUNNonlinSol_NewtonSens. IDASetNonlinearSolverSensStg must not be called afterwards.
  SUNNonlinearSolver nonlinear_solver = nullptr;
};

/// From now on the sensitivities of each step are moved onto C s_k + dg/dp_k = 0, in the metric of
/// the state's move, before IDAS tests their error and keeps them. Call it after IDASensInit with
/// IDA_STAGGERED, and again after another IDASensInit; IDASensReInit keeps it. Works with every
/// kind of constraints but UserProjection, which has no C. Without constraints it changes nothing.
/// Throws std::invalid_argument, naming the member and its value.
inline void project_sensitivities(Projection& projection, Sensitivities sensitivities) {
  projection.project_sensitivities(std::move(sensitivities));
}

}  // namespace tether::ida_projection
TETHER_EXPORT_END
