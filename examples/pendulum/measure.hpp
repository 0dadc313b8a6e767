// Tether: all runs of an experiment. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "drift_history.hpp"
#include "experiment.hpp"
#include "integrate.hpp"
#include "progress.hpp"

namespace pendulum {

/// A CPU time divided by plain IDA's, or why there is no such number.
struct Ratio {
  enum class Kind {
    value,
    never,    ///< plain IDA fails, or is never that accurate
    unknown,  ///< plain IDA was not run so loosely, or this run failed
  };
  Kind kind = Kind::unknown;
  double value = 0.0;
};

struct Result {
  Case what;
  Outcome outcome;             ///< cpu_ms: the fastest of the timed runs
  Drift drift;                 ///< largest over all accepted steps
  std::vector<Drift> history;  ///< only at Experiment::drift_tolerance
  Ratio same_tolerance;        ///< against plain IDA in the same form
  Ratio same_error;            ///< against plain IDA in the form that is faster there

  bool failed() const { return !outcome.failure.empty(); }
};

struct Results {
  Experiment experiment;
  std::vector<Result> runs;
};

/// Every case once with a measurement at every step, then the timed runs in rounds over all cases,
/// so that a busy machine disturbs all of them alike. What fails is not timed.
Results measure(const Experiment& experiment, tether::Progress& progress);

}  // namespace pendulum
