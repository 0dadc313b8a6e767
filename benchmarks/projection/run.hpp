// Tether: one run of a test problem by IDA, with or without the projection.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <problems/problem.hpp>
#include <string>
#include <tether/ida_projection.hpp>

namespace tether::bench {

struct Run {
  bool failed = false;
  int flag = 0;
  double error = 0.0, cpu_ms = 0.0;
  long steps = 0, residuals = 0, jacobians = 0, error_failures = 0, solver_failures = 0;
  ida_projection::Statistics projection;
  std::string message;
};

/// IDA with rtol = atol = tolerance, dense LU, difference Jacobian. `constraints`: attach the
/// projection with these and `options`; none: plain IDA. `suppress`: plain IDA's own
/// IDASetSuppressAlg. `give_id`: pass the problem's id to the options.
Run integrate(const problems::Problem& problem, double tolerance,
              const std::optional<ida_projection::Constraints>& constraints,
              ida_projection::Options options = {}, bool suppress = false, bool give_id = false,
              long maximum_steps = 2000000);

}  // namespace tether::bench
