// Tether: CPU time at equal end error, projected against plain IDA's best form.
// SPDX-License-Identifier: BSD-3-Clause
//
// Every form of a problem is run over a range of tolerances by plain IDA (with and without
// algebraic variables in the error test) and by the projection with its defaults. Single end errors
// scatter, so each code's curve is the least-squares line log CPU against log error of its form.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>

#include "curve.hpp"
#include "run.hpp"

using tether::problems::Problem;
using namespace tether::bench;

namespace {

/// Positions only, the measure that other comparisons of these problems use.
Problem by_positions(Problem problem, int positions) {
  problem.error_components = positions;
  return problem;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("CPU time at equal error against plain IDA's best form");
  int count = 21, repeats = 3;
  double loose = 1e-3, tight = 1e-11;
  std::string only;
  app.add_option("--count", count, "Number of tolerances")->check(CLI::Range(3, 1000));
  app.add_option("--loose", loose, "Largest tolerance")->check(CLI::PositiveNumber);
  app.add_option("--tight", tight, "Smallest tolerance")->check(CLI::PositiveNumber);
  app.add_option("--repeats", repeats, "Runs of which the fastest counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--problem", only, "Only problems whose name contains this");
  CLI11_PARSE(app, argc, argv);

  using namespace tether::problems;
  std::vector<Problem> swinging, car, squeezer;
  for (const char* form : {"index 1", "index 1 x2", "index 1 w", "index 0", "index 2", "GGL"})
    swinging.push_back(by_positions(pendulum(1, 1, 100, form), 2));
  for (const char* form : {"index 1", "index 1 w", "index 2"}) {
    car.push_back(by_positions(car_axis(form), 4));
    squeezer.push_back(by_positions(andrews(form), 7));
  }
  const std::vector<std::pair<std::string, std::vector<Problem>>> problems = {
      {"pendulum, t = 100", swinging}, {"car axis", car}, {"andrews", squeezer}};

  for (const auto& [name, forms] : problems) {
    if (name.find(only) == std::string::npos) continue;
    std::vector<Curve> plain, projected;
    for (const Problem& problem : forms) {
      Curve tested{problem.form, {}, {}}, suppressed{problem.form + ", suppressed", {}, {}},
          ours{problem.form, {}, {}};
      Settings settings[3];
      settings[1].suppress = true;
      settings[2].constraints = problem.recommended_constraints();
      for (Settings& each : settings) each.limits.steps = 300000;
      for (const double tolerance : tolerance_ladder(loose, tight, count)) {
        Run runs[3];
        for (int repeat = 0; repeat < repeats; ++repeat) {
          for (int i = 0; i < 3; ++i) {
            const Run now = integrate(problem, tolerance, settings[i]);
            if (repeat == 0 || now.cpu_ms < runs[i].cpu_ms) runs[i] = now;
          }
        }
        tested.add(runs[0].failed, runs[0].error, runs[0].cpu_ms);
        suppressed.add(runs[1].failed, runs[1].error, runs[1].cpu_ms);
        ours.add(runs[2].failed, runs[2].error, runs[2].cpu_ms);
      }
      plain.push_back(tested);
      plain.push_back(suppressed);
      projected.push_back(ours);
    }
    fmt::print("{}\n{:>8} {:>10} {:<26} {:>10} {:<14} {:>6}\n", name, "error", "plain ms", "form",
               "ours ms", "form", "ratio");
    GeometricMean ratio;
    for (int decade = 4; decade <= 9; ++decade) {
      const double error = std::pow(10.0, -decade);
      const Best a = best(plain, error), b = best(projected, error);
      fmt::print("{:>8.0e} {:>10.3f} {:<26} {:>10.3f} {:<14} {:>6.2f}\n", error, a.cpu, a.title,
                 b.cpu, b.title, b.cpu / a.cpu);
      ratio.add(b.cpu / a.cpu);
    }
    if (ratio.count() > 0) fmt::print("geometric mean {:.2f}\n\n", ratio.value());
  }
}
