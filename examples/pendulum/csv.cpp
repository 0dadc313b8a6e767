// Tether: files of the main job. SPDX-License-Identifier: BSD-3-Clause
#include "csv.hpp"

#include <fmt/os.h>

namespace pendulum {

namespace {

std::string field(const Ratio& ratio) {
  switch (ratio.kind) {
    case Ratio::Kind::value:
      return fmt::format("{:.4g}", ratio.value);
    case Ratio::Kind::never:
      return "never";
    case Ratio::Kind::unknown:
      break;
  }
  return "";
}

std::string identity(const Experiment& experiment, const Case& what) {
  return fmt::format("{},{},{},{},{},{},{:g}", experiment.pendulum, experiment.length,
                     experiment.gravity, experiment.duration, what.form, what.constraints("+"),
                     what.tolerance);
}

constexpr const char* kIdentity = "pendulum,L_m,g_m_per_s2,duration_s,form,constraints,tolerance";

// Numbers of a failed run would look like results: they stay empty.
std::string measured(const Result& run) {
  if (run.failed())
    return fmt::format("{},{:.6g},,,,{},{},,,", run.outcome.failure, run.outcome.reached,
                       run.outcome.steps, run.outcome.residuals);
  return fmt::format("ok,{:.6g},{:.4e},{:.4e},{:.4e},{},{},{:.4f},{},{}", run.outcome.reached,
                     run.outcome.error, run.drift.length, run.drift.energy, run.outcome.steps,
                     run.outcome.residuals, run.outcome.cpu_ms, field(run.same_tolerance),
                     field(run.same_error));
}

void write_runs(const std::filesystem::path& file, const std::vector<Results>& all) {
  fmt::ostream out = fmt::output_file(file.string());
  out.print(
      "{},status,t_reached_s,end_error,length_drift_m,energy_drift_J_per_kg,steps,"
      "residual_evaluations,cpu_ms,cpu_ratio_same_tolerance,cpu_ratio_same_error\n",
      kIdentity);
  for (const Results& results : all)
    for (const Result& run : results.runs)
      out.print("{},{}\n", identity(results.experiment, run.what), measured(run));
}

void write_drift(const std::filesystem::path& file, const std::vector<Results>& all) {
  fmt::ostream out = fmt::output_file(file.string());
  out.print("{},t_s,length_drift_m,energy_drift_J_per_kg\n", kIdentity);
  for (const Results& results : all)
    for (const Result& run : results.runs)
      for (const Drift& drift : run.history)
        out.print("{},{:.4e},{:.3e},{:.3e}\n", identity(results.experiment, run.what), drift.t,
                  drift.length, drift.energy);
}

}  // namespace

Files write_csv(const std::filesystem::path& folder, const std::vector<Results>& all) {
  const Files files = {folder / "pendulum.csv", folder / "pendulum_drift.csv"};
  write_runs(files[0], all);
  write_drift(files[1], all);
  return files;
}

void print_names(const Files& files) {
  fmt::print("\nwritten:\n");
  for (const std::filesystem::path& file : files) fmt::print("  {}\n", file.string());
}

}  // namespace pendulum
