// Tether: one run of IDA, with or without the projection. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <problems/problem.hpp>
#include <string>

#include "experiment.hpp"

namespace pendulum {

/// Outcome of a run.
struct Outcome {
  std::string failure;   ///< IDA's name of the failure; empty when the end was reached
  double reached = 0.0;  ///< time of the last accepted step, s
  double error = 0.0;    ///< at the end, see problems::Problem::error
  long steps = 0;        ///< accepted
  long residuals = 0;    ///< evaluations of F
  double cpu_ms = 0.0;   ///< process CPU time in IDASolve
};

/// Called after every accepted step.
using Observer = std::function<void(double t, const double* y)>;

tether::problems::Problem problem_of(const Experiment& experiment, const std::string& form);

/// IDA with its defaults (dense LU, difference Jacobian), rtol = atol = tolerance. With an observer
/// IDA returns after every step, which costs time: cpu_ms is of use only without one.
Outcome integrate(const tether::problems::Problem& problem, const Case& what,
                  const Observer& observer = {});

}  // namespace pendulum
