// Tether: a DAE test problem with its invariants and reference. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

namespace tether::problems {

/// One group of rows g(t, y) = 0 that belong together, with analytic Jacobian and row names.
struct Rows {
  std::string name;  ///< "position", "velocity", "acceleration", "energy", ...
  ida_projection::Constraints constraints;
};

/// dF/dy + cj dF/dy' in compressed columns, for what is too large for dense factors.
struct SparseJacobian {
  std::vector<int> starts;  ///< N + 1 indices into `rows`; empty: the problem has dense factors
  std::vector<int> rows;    ///< ascending in each column
  std::function<void(double t, double cj, const double* y, const double* yp, double* values)> fill;
};

/// F(t, y, y') = 0 with a consistent start, everything that its solution keeps, and a reference.
/// Copies are independent of each other.
struct Problem {
  std::string name;  ///< "pendulum"
  std::string form;  ///< "index 1"
  int index = 1;     ///< differentiation index of the form (0: solved for y')
  int size = 0;      ///< N, number of unknowns
  double t0 = 0.0;
  double t_end = 0.0;
  std::vector<double> y0, yp0;  ///< F(t0, y0, yp0) = 0 and every group of rows is 0
  std::vector<double> id;       ///< IDA's id: 1 differential, 0 algebraic

  /// r = F(t, y, yp), N values.
  std::function<void(double t, const double* y, const double* yp, double* r)> residual;
  /// J = dF/dy + cj dF/dy', N x N column-major, every entry written; may be empty.
  std::function<void(double t, double cj, const double* y, const double* yp, double* J)> jacobian;

  SparseJacobian sparse;

  /// The recommended rows as sparse ones; none: they are dense.
  std::optional<ida_projection::Constraints> sparse_constraints;

  std::vector<Rows> rows;                ///< each group separately
  std::vector<std::string> recommended;  ///< groups to project by default
  std::vector<double> reference;         ///< y(t_end); NaN where unknown
  int error_components = 0;              ///< of the first so many those with a reference count
  std::vector<double> atol_scale;        ///< factors of the absolute tolerance; empty: all 1
  /// Index of each unknown in Hairer and Wanner's sense (1, 2 or 3; not decreasing), by which
  /// RADAU5 scales errors; empty: all 1.
  std::vector<int> variable_index;
  double initial_step = 0.0;  ///< for IDASetInitStep; 0: the integrator's choice

  /// The named groups joined with `+`; std::invalid_argument for a name that is not there.
  ida_projection::Constraints select(const std::vector<std::string>& names) const;
  ida_projection::Constraints recommended_constraints() const;

  /// max |y_i - reference_i| / (1 + |reference_i|) over the compared components; NaN if
  /// none of them is known or y is not finite.
  double error(const double* y) const;
};

}  // namespace tether::problems
