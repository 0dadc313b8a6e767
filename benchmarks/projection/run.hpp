// Tether: one run of a test problem by IDA, with or without the projection.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <problems/problem.hpp>
#include <string>
#include <tether/ida_projection.hpp>
#include <vector>

#include "context.hpp"

namespace tether::bench {

/// Called at every accepted step: time, unknowns (of the problem's form), order (0: not known).
/// Runs that are watched are not timed.
using Watch = std::function<void(double t, const double* y, int order)>;

/// Ends runs that got stuck.
struct Limits {
  long steps = 2000000;
  double cpu_seconds = 1e9;
};

struct Run {
  bool failed = false;
  int flag = 0;  ///< of the integrator
  double error = 0.0, cpu_ms = 0.0;
  /// F evaluations include those of difference Jacobians and of the projection.
  long steps = 0, residuals = 0, jacobians = 0, factorizations = 0, error_failures = 0,
       solver_failures = 0, projections = 0;
  ida_projection::Statistics projection;
  std::string message;
  std::vector<double> y;  ///< at t_end
};

struct Settings {
  /// Attach the projection with these; none: plain IDA.
  std::optional<ida_projection::Constraints> constraints;
  ida_projection::Options options = {};
  bool suppress = false;  ///< plain IDA's own IDASetSuppressAlg
  bool give_id = false;   ///< pass the problem's id to the options
  bool fast = false;      ///< fast_vector, and fast_dense_solver where the matrix is small enough
  Limits limits = {};
  Watch watch;
};

/// IDA with rtol = atol = tolerance, dense LU, difference Jacobian; a sparse problem has KLU and
/// its own Jacobian, where SUNDIALS has KLU.
Run integrate(const problems::Problem& problem, double tolerance, Settings settings = {});

}  // namespace tether::bench
