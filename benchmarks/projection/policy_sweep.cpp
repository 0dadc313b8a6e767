// Tether: many tolerances on every problem, projected against plain IDA in the same form.
// SPDX-License-Identifier: BSD-3-Clause
//
// Single end errors scatter by a factor of three, so only means over many tolerances say something
// about a default. Each cell is a geometric mean of (variant / plain IDA) over the tolerances at
// which both finish.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <map>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>
#include <problems/slider_crank.hpp>

#include "curve.hpp"
#include "run.hpp"

namespace tp = tether::ida_projection;
using tether::problems::Problem;
using namespace tether::bench;

namespace {

const std::map<std::string, tp::Options> kVariants = [] {
  std::map<std::string, tp::Options> variants;
  variants["default"] = {};
  variants["no polish"].advanced.polish = tp::Polished::none;
  variants["no refresh"].advanced.polish = tp::Polished::differential;
  variants["error weights"].advanced.metric = tp::Metric::error_weights;
  variants["algebraic tested"].suppress_algebraic = false;
  variants["error weights, no polish"].advanced.metric = tp::Metric::error_weights;
  variants["error weights, no polish"].advanced.polish = tp::Polished::none;
  return variants;
}();

std::vector<Problem> all_problems() {
  using namespace tether::problems;
  return {pendulum(1, 1, 100, "index 1"),
          pendulum(1, 1, 100, "index 0"),
          pendulum(1, 9.81, 10, "index 1"),
          pendulum(1, 9.81, 10, "index 1 w"),
          car_axis("index 1"),
          car_axis("index 1 w"),
          andrews("index 1"),
          andrews("index 1 w"),
          slider_crank("index 1"),
          slider_crank("index 1 w")};
}

Run fastest(int repeats, const std::function<Run()>& run) {
  Run best = run();
  for (int k = 1; k < repeats; ++k) best.cpu_ms = std::min(best.cpu_ms, run().cpu_ms);
  return best;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Projected runs against plain IDA over many tolerances");
  int count = 40, repeats = 3;
  double loose = 1e-4, tight = 1e-9;
  std::string only;
  std::vector<std::string> variants = {"default"};
  bool verbose = false, give_id = false;
  app.add_option("--count", count, "Number of tolerances")->check(CLI::Range(1, 1000));
  app.add_option("--loose", loose, "Largest tolerance")->check(CLI::PositiveNumber);
  app.add_option("--tight", tight, "Smallest tolerance")->check(CLI::PositiveNumber);
  app.add_option("--repeats", repeats, "Runs of which the fastest counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--problem", only, "Only problems whose name and form contain this");
  std::vector<std::string> known;
  for (const auto& [name, options] : kVariants) known.push_back(name);
  app.add_option("--variants", variants, "Which policies")->check(CLI::IsMember(known));
  app.add_flag("--give-id", give_id, "Pass the id vector instead of having it derived");
  app.add_flag("--verbose", verbose, "A line for each run");
  CLI11_PARSE(app, argc, argv);

  fmt::print("{:<24} {:<22} {:>6} {:>6} {:>9} {:>6} {:>6}  {}\n", "problem, form", "variant",
             "steps", "worst", "error", "CPU", "worst", "failures of plain, of ours");
  for (const Problem& problem : all_problems()) {
    const std::string title = problem.name + ", " + problem.form;
    if (title.find(only) == std::string::npos) continue;
    std::map<std::string, GeometricMean> steps, error, cpu;
    std::map<std::string, int> failures;
    for (const double tolerance : tolerance_ladder(loose, tight, count)) {
      const Run plain = fastest(repeats, [&] { return integrate(problem, tolerance); });
      if (plain.failed) ++failures["plain"];
      for (const std::string& variant : variants) {
        const Run run = fastest(repeats, [&] {
          Settings settings;
          settings.constraints = problem.recommended_constraints();
          settings.options = kVariants.at(variant);
          settings.give_id = give_id;
          return integrate(problem, tolerance, settings);
        });
        if (verbose)
          fmt::print(
              "  {:.3e} {:<22} flag {} error {:.2e} ({:.2e}) steps {} ({}) F {} CPU {:.2f} "
              "({:.2f}) {}\n",
              tolerance, variant, run.flag, run.error, plain.error, run.steps, plain.steps,
              run.residuals, run.cpu_ms, plain.cpu_ms, run.message);
        if (run.failed) ++failures[variant];
        if (run.failed || plain.failed) continue;
        steps[variant].add(static_cast<double>(run.steps) / static_cast<double>(plain.steps));
        error[variant].add(run.error / plain.error);
        cpu[variant].add(run.cpu_ms / plain.cpu_ms);
      }
    }
    for (const std::string& variant : variants)
      fmt::print("{:<24} {:<22} {:>6.3f} {:>6.2f} {:>9.2e} {:>6.3f} {:>6.2f}  {} {}\n", title,
                 variant, steps[variant].value(), steps[variant].largest(), error[variant].value(),
                 cpu[variant].value(), cpu[variant].largest(), failures["plain"],
                 failures[variant]);
    std::fflush(stdout);
  }
}
