// Tether: steps, evaluations of F and end errors over all problems, as CSV.
// SPDX-License-Identifier: BSD-3-Clause
//
// ablation [--without MECHANISM] [--times F] [PROBLEM...], tolerances times F; ablation
// --mechanisms lists mechanisms. Those that are no options can be switched off in builds with
// TETHER_ABLATION.
#include <fmt/format.h>

#include <cstdlib>
#include <functional>
#include <problems/link_chain.hpp>

#include "ablation/others.hpp"
#include "accuracy/catalogue.hpp"
#include "host/mechanisms.hpp"
#include "projection/run.hpp"

using namespace tether;

namespace {

double tolerances[] = {1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8};
// Runs that get stuck end: the longest ones that do not take 18 141 steps, and 2375 of large
// problems.
constexpr long kMostSteps = 20000, kMostStepsOfLarge = 3000;
constexpr int kLongRuns = 30;                // unknowns; beyond them runs are short
constexpr double kTightestOfRods = 1e-4;     // dense factors of 300 unknowns
constexpr int kMiddling = 12, kLarge = 100;  // unknowns

using ida_projection::Options;

struct Switch {
  const char* name;
  void (*off)(Options&);
};
constexpr Switch kOptions[] = {
    {"local metric", [](Options& o) { o.advanced.metric = ida_projection::Metric::error_weights; }},
    {"polish", [](Options& o) { o.advanced.polish = ida_projection::Polished::none; }},
    {"smoothing in index 2", [](Options& o) { o.advanced.smooth_where_needed = false; }},
    {"limit of the order", [](Options& o) { o.advanced.limit_order = false; }},
    {"multipliers out of the error test", [](Options& o) { o.suppress_algebraic = false; }}};

const char* size_class(int unknowns) {
  return unknowns >= kLarge ? "big" : unknowns > kMiddling ? "mid" : "small";
}

void run(const std::string& name, const problems::Problem& problem, double tolerance,
         const Options& options, const char* group) {
  bench::Settings settings;
  settings.constraints =
      problem.sparse_constraints ? *problem.sparse_constraints : problem.recommended_constraints();
  settings.options = options;
  settings.limits.steps = problem.size <= kLongRuns ? kMostSteps : kMostStepsOfLarge;
  const bench::Run result = bench::integrate(problem, tolerance, settings);
  fmt::print("{},{},{:.0e},{},{},{},{:.6e},{}\n", name, problem.form, tolerance, group,
             result.steps, result.residuals, result.error, result.failed ? 1 : 0);
  std::fflush(stdout);
}

void list() {
  for (const Switch& option : kOptions) fmt::print("{}\n", option.name);
#ifdef TETHER_ABLATION
  for (const char* name : ida_projection::kMechanismNames) fmt::print("{}\n", name);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> only(argv + 1, argv + argc);
  if (!only.empty() && only[0] == "--mechanisms") return list(), 0;
  Options options;
  options.print = false;
  if (only.size() > 1 && only[0] == "--without") {
    setenv("TETHER_WITHOUT", only[1].c_str(), 1);
    for (const Switch& option : kOptions)
      if (only[1] == option.name) option.off(options);
    only.erase(only.begin(), only.begin() + 2);
  }
  if (only.size() > 1 && only[0] == "--times") {
    for (double& tolerance : tolerances) tolerance *= std::stod(only[1]);
    only.erase(only.begin(), only.begin() + 2);
  }
  fmt::print("problem,form,tolerance,class,steps,F,error,failed\n");
  for (const bench::Case& which : bench::selected(bench::catalogue(), only, {"long pendulum"}))
    for (const problems::Problem& form : which.forms)
      for (const double tolerance : tolerances)
        if (form.index <= 2) run(which.name, form, tolerance, options, size_class(form.size));
  if (!only.empty()) return 0;
  for (const int links : {20, 50, 200})
    for (const double tolerance : {1e-4, 1e-6})
      run(fmt::format("chain of {}", links), problems::link_chain(links, links < 100 ? 0.5 : 0.2),
          tolerance, options, "big");
  for (const problems::Problem& other : bench::others())
    for (const double tolerance : tolerances) run(other.name, other, tolerance, options, "others");
  for (const problems::Problem& chain : bench::chains_of_rods())
    for (const double tolerance : tolerances)
      if (tolerance >= kTightestOfRods) run(chain.name, chain, tolerance, options, "rods");
}
