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

#include "run.hpp"

using tether::problems::Problem;
using tether::bench::integrate;
using tether::bench::Run;

namespace {

struct Curve {
  std::string title;
  std::vector<double> log_error, log_cpu;

  void add(const Run& run) {
    if (run.failed || !(run.error > 0.0) || !(run.error < 1e-1)) return;
    log_error.push_back(std::log10(run.error));
    log_cpu.push_back(std::log10(run.cpu_ms));
  }

  /// CPU in ms at this error from the line through the runs; NaN outside what was reached.
  double cpu_at(double error) const {
    const auto n = static_cast<double>(log_error.size());
    const double x = std::log10(error);
    if (n < 3 || x < *std::min_element(log_error.begin(), log_error.end()) - 0.3 ||
        x > *std::max_element(log_error.begin(), log_error.end()) + 0.3)
      return std::nan("");
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (std::size_t i = 0; i < log_error.size(); ++i) {
      sx += log_error[i];
      sy += log_cpu[i];
      sxx += log_error[i] * log_error[i];
      sxy += log_error[i] * log_cpu[i];
    }
    const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    return std::pow(10.0, (sy - slope * sx) / n + slope * x);
  }
};

/// Positions only, the measure that other comparisons of these problems use.
Problem by_positions(Problem problem, int positions) {
  problem.error_components = positions;
  return problem;
}

struct Best {
  double cpu = std::nan("");
  std::string title = "-";
};

Best best(const std::vector<Curve>& curves, double error) {
  Best found;
  for (const Curve& curve : curves) {
    const double cpu = curve.cpu_at(error);
    if (std::isnan(cpu) || cpu >= found.cpu) continue;
    found = {cpu, curve.title};
  }
  return found;
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
  app.add_option("--repeats", repeats, "Runs of which the fastest counts")->check(CLI::Range(1, 100));
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
      for (int k = 0; k < count; ++k) {
        const double tolerance = loose * std::pow(tight / loose, static_cast<double>(k) / (count - 1));
        Run runs[3];
        for (int repeat = 0; repeat < repeats; ++repeat) {
          const Run now[3] = {integrate(problem, tolerance, std::nullopt, {}, false, false, 300000),
                              integrate(problem, tolerance, std::nullopt, {}, true, false, 300000),
                              integrate(problem, tolerance, problem.recommended_constraints(), {},
                                        false, false, 300000)};
          for (int i = 0; i < 3; ++i)
            if (repeat == 0 || now[i].cpu_ms < runs[i].cpu_ms) runs[i] = now[i];
        }
        tested.add(runs[0]);
        suppressed.add(runs[1]);
        ours.add(runs[2]);
      }
      plain.push_back(tested);
      plain.push_back(suppressed);
      projected.push_back(ours);
    }
    fmt::print("{}\n{:>8} {:>10} {:<26} {:>10} {:<14} {:>6}\n", name, "error", "plain ms", "form",
               "ours ms", "form", "ratio");
    double sum = 0.0;
    int used = 0;
    for (int decade = 4; decade <= 9; ++decade) {
      const double error = std::pow(10.0, -decade);
      const Best a = best(plain, error), b = best(projected, error);
      fmt::print("{:>8.0e} {:>10.3f} {:<26} {:>10.3f} {:<14} {:>6.2f}\n", error, a.cpu, a.title, b.cpu,
                 b.title, b.cpu / a.cpu);
      if (b.cpu / a.cpu > 0.0) sum += std::log(b.cpu / a.cpu), ++used;
    }
    if (used > 0) fmt::print("geometric mean {:.2f}\n\n", std::exp(sum / used));
  }
}
