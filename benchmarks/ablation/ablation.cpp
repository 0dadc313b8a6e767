// Tether: steps, evaluations of F and end errors over all problems, as CSV.
// SPDX-License-Identifier: BSD-3-Clause
//
// ablation > before.csv; change something; ablation > after.csv; compare.py before.csv after.csv
#include <fmt/format.h>

#include <cstdlib>
#include <problems/link_chain.hpp>

#include "accuracy/catalogue.hpp"
#include "projection/run.hpp"

using namespace tether;

namespace {

constexpr double kTolerances[] = {1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8};
constexpr double kLongestSeconds = 20.0;
constexpr int kMiddling = 12, kLarge = 100;  // unknowns

const char* size_class(int unknowns) {
  return unknowns >= kLarge ? "big" : unknowns > kMiddling ? "mid" : "small";
}

void run(const std::string& name, const problems::Problem& problem, double tolerance) {
  bench::Settings settings;
  settings.constraints =
      problem.sparse_constraints ? *problem.sparse_constraints : problem.recommended_constraints();
  settings.options.print_fatal = settings.options.print_warnings = false;
  settings.limits.cpu_seconds = kLongestSeconds;
  const bench::Run result = bench::integrate(problem, tolerance, settings);
  fmt::print("{},{},{:.0e},{},{},{},{:.6e},{}\n", name, problem.form, tolerance,
             size_class(problem.size), result.steps, result.residuals, result.error,
             result.failed ? 1 : 0);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> only(argv + 1, argv + argc);
  fmt::print("problem,form,tolerance,class,steps,F,error,failed\n");
  for (const bench::Case& which : bench::catalogue(only, {"long pendulum"}))
    for (const problems::Problem& form : which.forms)
      for (const double tolerance : kTolerances)
        if (form.index <= 2) run(which.name, form, tolerance);
  if (!only.empty()) return 0;
  for (const int links : {20, 50, 200})
    for (const double tolerance : {1e-4, 1e-6})
      run(fmt::format("chain of {}", links), problems::link_chain(links, links < 100 ? 0.5 : 0.2),
          tolerance);
}
