// Tether: one run of a problem, to be profiled. SPDX-License-Identifier: BSD-3-Clause
//
//   one_run PROBLEM FORM TOLERANCE [plain] [fast]
//
//   valgrind --tool=callgrind --toggle-collect=IDASolve one_run "car axis" "index 2" 1e-6 plain
//   fast
#include <fmt/core.h>

#include <cstdlib>
#include <cstring>
#include <problems/akzo_nobel.hpp>
#include <problems/car_axis.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/nand_gate.hpp>
#include <problems/pendulum.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/two_bit_adder.hpp>
#include <problems/water_tube.hpp>
#include <problems/wheelset.hpp>

#include "projection/run.hpp"

using namespace tether;

namespace {

// Those of the comparison of codes, each made by itself: a profiler sees nothing of the others.
problems::Problem problem_of(const std::string& name, const std::string& form) {
  using namespace problems;
  if (name == "pendulum") return pendulum(1, 9.81, 10, form);
  if (name == "car axis") return car_axis(form);
  if (name == "akzo nobel") return akzo_nobel();
  if (name == "rigid body") return rigid_body("dzhanibekov", 100.0);
  if (name == "robertson") return robertson(4e5, form);
  if (name == "nand gate") return nand_gate(form);
  if (name == "water tube") return water_tube();
  if (name == "wheelset") return wheelset();
  if (name == "two-bit adder") return two_bit_adder();
  if (name == "lotka volterra") return lotka_volterra(2, 0.5, 100);
  throw std::invalid_argument("one_run: no problem is called " + name);
}

int run(const problems::Problem& problem, int argc, char** argv) {
  bench::Settings settings;
  settings.constraints = problem.recommended_constraints();
  for (int k = 4; k < argc; ++k) {
    if (!std::strcmp(argv[k], "plain")) settings.constraints.reset();
    if (!std::strcmp(argv[k], "fast")) settings.fast = true;
  }
  const bench::Run run = bench::integrate(problem, std::atof(argv[3]), settings);
  fmt::print("{} steps, {} evaluations of F, {} factorisations, error {:.3e}, {:.3g} ms {}\n",
             run.steps, run.residuals, run.factorizations, run.error, run.cpu_ms, run.message);
  return run.failed;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    fmt::print(stderr, "one_run PROBLEM FORM TOLERANCE [plain] [fast]\n");
    return 2;
  }
  try {
    return run(problem_of(argv[1], argv[2]), argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
