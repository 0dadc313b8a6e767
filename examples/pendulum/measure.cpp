// Tether: all runs of an experiment. SPDX-License-Identifier: BSD-3-Clause
#include "measure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <limits>

namespace pendulum {

namespace {

std::string title(const Experiment& experiment, const Case& what) {
  return fmt::format("{} pendulum, {:g} s: {}, {}, {:g}", experiment.pendulum, experiment.duration,
                     what.form, what.constraints(), what.tolerance);
}

Result observe(const Experiment& experiment, const Case& what, tether::Progress& progress) {
  Result result;
  result.what = what;
  DriftHistory history(experiment);
  progress.start(title(experiment, what), experiment.duration, expected_work(experiment, what));
  result.outcome =
      integrate(problem_of(experiment, what.form), what, [&](double t, const double* y) {
        history.add(t, y);
        progress.at(t);
      });
  progress.finish();
  result.drift = history.largest();
  if (what.tolerance == experiment.drift_tolerance) result.history = history.windows();
  result.outcome.cpu_ms = std::numeric_limits<double>::infinity();
  return result;
}

void time(const Experiment& experiment, Result& result, tether::Progress& progress) {
  progress.start(title(experiment, result.what), experiment.duration,
                 expected_work(experiment, result.what));
  if (!result.failed()) {
    const Outcome again = integrate(problem_of(experiment, result.what.form), result.what);
    result.outcome.cpu_ms = std::min(result.outcome.cpu_ms, again.cpu_ms);
  }
  progress.finish();
}

}  // namespace

Results measure(const Experiment& experiment, tether::Progress& progress) {
  Results results{experiment, {}};
  for (const Case& what : experiment.cases)
    results.runs.push_back(observe(experiment, what, progress));
  for (int round = 0; round < experiment.repeats; ++round)
    for (Result& result : results.runs) time(experiment, result, progress);
  return results;
}

}  // namespace pendulum
