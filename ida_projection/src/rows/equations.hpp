// Tether: rows whose algebraic variables F determines, joined with the equations that do so.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

#include "constraints/evaluator.hpp"

namespace tether::ida_projection {

/// F(t, y, y') at any y, with y' as it stands; N values. False: F failed.
using Residual = std::function<bool(const double* y, double* f)>;

/// The equations h(t, y) = 0 of F that contain no derivative determine some of the algebraic
/// variables, y_u = Y(y_d): contact points from tangency, say. A row g(y_d, y_u) then says
/// something about y_d: with h_u dy_u + h_d dy_d = 0 it asks for
///
///     (C_d - C_u h_u^-1 h_d) dy_d = g,
///
/// and solved for y_u alone it would violate F. Such rows are moved together with the equations h
/// that determine their y_u, over y_d and y_u jointly (method, section 6).
struct JoinedEquations {
  std::vector<int> equations;             ///< indices into F; empty: nothing has to be joined
  std::vector<std::vector<int>> columns;  ///< the unknowns in each, ascending
  std::vector<char> moves;                ///< N: algebraic variables that move with the rest
  std::vector<char> repeats;  ///< of each row: it is an equation of F, up to a factor; empty: none
};

/// Finds the equations to join at the point y. `derivative_free()`: the equations of F without y'.
/// id: 1 differential, 0 algebraic. WT: error weights. Nothing is joined for rows that repeat
/// equations of F (a tension row), nor for rows whose algebraic variables F does not determine in
/// this way (multipliers of velocity rows): these are solved for their algebraic variables.
/// Without rows that contain free algebraic variables, however weakly, F is not evaluated; if F is
/// of index 1 and the rows are its equations, it is hardly.
JoinedEquations find_joined_equations(Evaluator& rows, const Residual& residual,
                                      const std::function<std::vector<char>()>& derivative_free,
                                      double t, const std::vector<double>& y,
                                      const std::vector<double>& WT, const std::vector<bool>& hold,
                                      const double* id, bool index_is_low);

/// The equations as a set, their Jacobian by differences, one evaluation of F for all columns that
/// no equation shares. weights: 1/WT at the present candidate.
Constraints as_constraints(const JoinedEquations& found, Residual residual,
                           std::function<const double*()> weights, int size);

}  // namespace tether::ida_projection
