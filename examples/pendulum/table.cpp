// Tether: the tables of the main job. SPDX-License-Identifier: BSD-3-Clause
#include "table.hpp"

#include <fmt/core.h>

#include <cmath>
#include <cstdio>

#include "compare.hpp"

namespace pendulum {

namespace {

std::string text(const Ratio& ratio) {
  switch (ratio.kind) {
    case Ratio::Kind::value:
      return ratio.value < 9.995 ? fmt::format("{:.2f}", ratio.value)
                                 : fmt::format("{:.0f}", ratio.value);
    case Ratio::Kind::never:
      return "never";
    case Ratio::Kind::unknown:
      break;
  }
  return "-";
}

std::string milliseconds(double ms) {
  return ms < 9.995   ? fmt::format("{:.2f}", ms)
         : ms < 99.95 ? fmt::format("{:.1f}", ms)
                      : fmt::format("{:.0f}", ms);
}

void print_run(const Result& run) {
  fmt::print("{:<8} {:<34} {:>6.0e} ", run.what.form,
             run.what.plain() ? "none (plain IDA)" : run.what.constraints(), run.what.tolerance);
  if (run.failed())
    fmt::print("  fails at t = {:.4g} after {} steps: {}\n", run.outcome.reached, run.outcome.steps,
               run.outcome.failure);
  else
    fmt::print("{:>9.1e} {:>9.1e} {:>9.1e} {:>8} {:>8} {:>9} {:>10}\n", run.outcome.error,
               run.drift.length, run.drift.energy, run.outcome.steps,
               milliseconds(run.outcome.cpu_ms), text(run.same_tolerance), text(run.same_error));
}

/// Looser than the loosest run: its time is a bound. Plain IDA was run as tightly as it can be.
std::string cost(const Curve& curve, double error) {
  const Ratio ms = time_for(curve, error);
  switch (ms.kind) {
    case Ratio::Kind::value:
      return milliseconds(ms.value);
    case Ratio::Kind::unknown:
      return "< " + milliseconds(curve.points.front()->outcome.cpu_ms);
    case Ratio::Kind::never:
      break;
  }
  return curve.invariants == Invariants::none ? "never" : "-";
}

const char* describe(Invariants invariants) {
  switch (invariants) {
    case Invariants::none:
      return "plain IDA";
    case Invariants::without_energy:
      return "no energy";
    case Invariants::with_energy:
      break;
  }
  return "energy";
}

std::string title(const Experiment& e) {
  return fmt::format("{} pendulum, L = {:g} m, g = {:g} m/s^2, {:g} s",
                     e.pendulum == "earth" ? "Earth" : "Unit", e.length, e.gravity, e.duration);
}

void print_costs(const Results& results) {
  const std::vector<Curve> all = curves(results);
  fmt::print("\n{}\n\n{:<9}", title(results.experiment), "");
  for (const Curve& curve : all) fmt::print(" {:>10}", curve.form);
  fmt::print("\n{:<9}", "end error");
  for (const Curve& curve : all) fmt::print(" {:>10}", describe(curve.invariants));
  fmt::print("\n");
  for (int exponent = -1; exponent >= -9; --exponent) {
    const double error = std::pow(10.0, exponent);
    fmt::print("{:<9.0e}", error);
    for (const Curve& curve : all) fmt::print(" {:>10}", cost(curve, error));
    fmt::print("\n");
  }
}

}  // namespace

void print_explanation() {
  fmt::print(
      "A pendulum in Cartesian coordinates, from the horizontal at rest; index 1: v^2 - g y = L^2 "
      "lambda,\n"
      "index 0: L^2 lambda' = -3 g vy. Each run is one call of IDASolve with rtol = atol = tol.\n\n"
      "end error    max |y_i - exact_i| / (1 + |exact_i|) over position and velocity at the end\n"
      "drift        largest over all accepted steps: | |r| - L | and | v^2/2 + g y |\n"
      "CPU time     process time in IDASolve, the fastest of several interleaved runs\n"
      "same tol     CPU time / that of plain IDA in the same form at the same tolerance\n"
      "same error   CPU time / that of plain IDA in the faster form for the same end error\n"
      "             (interpolated; for this plain IDA is run down to tol = 1e-13, and 1e-12 over "
      "1000 s)\n"
      "never        plain IDA fails, or is not that accurate at any tolerance\n");
}

void print_runs(const Results& results) {
  fmt::print("\n{}\n\n", title(results.experiment));
  fmt::print("{:>77} {:>36}\n", "largest drift of", "CPU time / plain IDA's");
  fmt::print("{:<8} {:<34} {:>6} {:>9} {:>9} {:>9} {:>8} {:>8} {:>9} {:>10}\n", "form",
             "constraints", "tol", "end error", "length/m", "E/(J/kg)", "steps", "CPU/ms",
             "same tol", "same error");
  for (const Result& run : results.runs) print_run(run);
  std::fflush(stdout);
}

void print_costs(const std::vector<Results>& all) {
  fmt::print(
      "\nWhat accuracy costs: CPU time in ms for an end error, interpolated between the runs "
      "above;\n"
      "<: already the loosest run is more accurate; -: tighter than the runs above\n");
  for (const Results& results : all) print_costs(results);
  std::fflush(stdout);
}

}  // namespace pendulum
