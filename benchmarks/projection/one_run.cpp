// Tether: one run of the car axis, to be profiled. SPDX-License-Identifier: BSD-3-Clause
//
//   one_run FORM TOLERANCE [plain] [fast]
//
//   valgrind --tool=callgrind --toggle-collect=IDASolve one_run "index 2" 1e-6 plain fast
#include <fmt/core.h>

#include <cstdlib>
#include <cstring>
#include <problems/car_axis.hpp>

#include "run.hpp"

using namespace tether;

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "one_run FORM TOLERANCE [plain] [fast]\n");
    return 2;
  }
  const problems::Problem problem = problems::car_axis(argv[1]);
  bench::Settings settings;
  settings.constraints = problem.recommended_constraints();
  for (int k = 3; k < argc; ++k) {
    if (!std::strcmp(argv[k], "plain")) settings.constraints.reset();
    if (!std::strcmp(argv[k], "fast")) settings.fast = true;
  }
  const bench::Run run = bench::integrate(problem, std::atof(argv[2]), settings);
  fmt::print("{} steps, {} evaluations of F, {} factorisations, error {:.3e}, {:.3g} ms {}\n",
             run.steps, run.residuals, run.factorizations, run.error, run.cpu_ms, run.message);
  return run.failed;
}
