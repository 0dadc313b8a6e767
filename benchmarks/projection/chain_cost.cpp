// Tether: what the projection adds to a step of IDA with KLU. SPDX-License-Identifier: BSD-3-Clause
//
//   chain_cost [--links 100,1000,10000] [--tolerances 1e-4,1e-6] [--end 0.1] [--repeats 3]
//
// A chain of links falls from the horizontal. Plain IDA, plain IDA whose algebraic variables are
// out of the error test (IDASetSuppressAlg, its best form here, as the projection has them) and IDA
// with the projection take turns in one process, so that the load of the machine reaches all;
// medians of processor time. ratio: of a step to that of suppressed plain IDA; run: of the whole
// run.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <problems/link_chain.hpp>
#include <vector>

#include "run.hpp"

using namespace tether;

namespace {

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct Kind {
  const char* name;
  bool suppressed, projected;
  bench::Run run = {};
  std::vector<double> each = {};  // microseconds a step and link
  double step() const { return median(each); }
  double whole() const { return step() * static_cast<double>(run.steps); }
};

// The tip falls freely as long as the wave from the pin has not reached it.
double tip_error(const problems::Problem& problem, int links, const std::vector<double>& y) {
  const double* last = y.data() + 3 * (links - 1);
  return std::abs(last[1] + 0.05 * std::sin(last[2]) + 4.905 * problem.t_end * problem.t_end);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<int> links = {100, 1000, 10000};
  std::vector<double> tolerances = {1e-4, 1e-6};
  double end = 0.1;
  int repeats = 3;
  CLI::App app("What the projection adds to a step of IDA with KLU");
  app.add_option("--links", links)->delimiter(',')->check(CLI::Range(2, 100000));
  app.add_option("--tolerances", tolerances)->delimiter(',');
  app.add_option("--end", end);
  app.add_option("--repeats", repeats)->check(CLI::Range(1, 1000));
  CLI11_PARSE(app, argc, argv);

  fmt::print("{:>6} {:>7} {:<12} {:>6} {:>6} {:>5} {:>12} {:>6} {:>6} {:>9} {:>9}\n", "links",
             "tol", "", "steps", "F", "LU", "us/step/link", "ratio", "run", "tip off", "worst g");
  bool failed = false;
  for (const int N : links) {
    const problems::Problem problem = problems::link_chain(N, end);
    const ida_projection::Constraints rows = problem.sparse_constraints.value();
    for (const double tolerance : tolerances) {
      Kind kinds[] = {
          {"tested", false, false}, {"suppressed", true, false}, {"projected", false, true}};
      const Kind& best = kinds[1];
      for (int k = 0; k < repeats; ++k)
        for (Kind& kind : kinds) {
          bench::Settings settings;
          settings.suppress = kind.suppressed;
          if (kind.projected) settings.constraints = rows;
          kind.run = bench::integrate(problem, tolerance, settings);
          kind.each.push_back(1e3 * kind.run.cpu_ms / static_cast<double>(kind.run.steps) / N);
          failed = failed || kind.run.failed;
        }
      for (const Kind& kind : kinds) {
        std::vector<double> g(static_cast<std::size_t>(4 * N));
        rows.value(end, {kind.run.y.data(), problem.size}, {g.data(), 4 * N});
        const auto [least, most] = std::minmax_element(g.begin(), g.end());
        fmt::print(
            "{:>6} {:>7.0e} {:<12} {:>6} {:>6} {:>5} {:>12.3f} {:>6.2f} {:>6.2f} {:>9.1e} {:>9.1e} "
            "{}\n",
            N, tolerance, kind.name, kind.run.steps, kind.run.residuals, kind.run.factorizations,
            kind.step(), kind.step() / best.step(), kind.whole() / best.whole(),
            tip_error(problem, N, kind.run.y), std::max(-*least, *most), kind.run.message);
        std::fflush(stdout);
      }
    }
  }
  return failed;
}
