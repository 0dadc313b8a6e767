// Tether: nanoseconds of one projection, without IDA around it. SPDX-License-Identifier:
// BSD-3-Clause
//
// A candidate half a tolerance off the constraints is moved onto them, again and again: metric, g,
// C, factorisation, solution and update of the candidate. Best of several batches.
#include <fmt/core.h>
#include <nvector/nvector_serial.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <movers/rows_at.hpp>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>

#include "context.hpp"

namespace tp = tether::ida_projection;
using tether::problems::Problem;

namespace {

/// The problem's rows at its start, whose algebraic columns are empty and therefore not moved.
void measure(const Problem& problem, int batches, int moves) {
  SUNContext context = tether::bench::make_context();
  N_Vector base = N_VNew_Serial(problem.size, context);
  N_Vector correction = N_VClone(base), weights = N_VClone(base), id = N_VClone(base);
  const double tolerance = 1e-6;
  for (int j = 0; j < problem.size; ++j) {
    const auto i = static_cast<std::size_t>(j);
    N_VGetArrayPointer(base)[j] = problem.y0[i];
    N_VGetArrayPointer(weights)[j] = 1.0 / (tolerance * (std::abs(problem.y0[i]) + 1.0));
    N_VGetArrayPointer(id)[j] = problem.id[i];
  }
  const auto perturb = [&] {
    for (int j = 0; j < problem.size; ++j)
      N_VGetArrayPointer(correction)[j] =
          0.5 * std::sin(1.0 + 2.0 * j) / N_VGetArrayPointer(weights)[j];
  };

  const tp::Constraints constraints = problem.recommended_constraints();
  const tp::Options options;
  tp::Statistics statistics;
  const std::unique_ptr<tp::RowsAt> rows =
      tp::make_contiguous_rows(constraints, options, statistics, problem.size, false);
  tp::Candidate candidate{problem.t0, base, correction, weights};
  candidate.with_entries();
  perturb();
  rows->set_algebraic(candidate, id, {});

  double best = 1e300;
  bool success = true;
  for (int batch = 0; batch < batches; ++batch) {
    double spent = 0.0;
    for (int k = 0; k < moves; ++k) {
      perturb();
      const auto begin = std::chrono::steady_clock::now();
      // From the second one on points are a hundredth of a tolerance off: where nothing is to be
      // moved, only g would be evaluated.
      constexpr int kRepeat = 16;
      for (int repeat = 0; repeat < kRepeat; ++repeat) {
        success = rows->move(candidate).status == tp::Status::success && success;
        candidate.correction_entries[0] += 0.01 / candidate.weight_entries[0];
      }
      spent +=
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / kRepeat;
    }
    best = std::min(best, spent / moves);
  }
  fmt::print("{:<12} {:<10} rows {:>2}  {:>7.0f} ns per projection, {:.2f} moves each{}\n",
             problem.name, problem.form, constraints.total_count(), 1e9 * best,
             static_cast<double>(statistics.iterations) / (16.0 * batches * moves),
             success ? "" : "  FAILED");
  for (N_Vector v : {base, correction, weights, id}) N_VDestroy(v);
  SUNContext_Free(&context);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Nanoseconds of one projection");
  int batches = 50, moves = 500;
  app.add_option("--batches", batches, "Batches of which the fastest counts")
      ->check(CLI::Range(1, 10000));
  app.add_option("--moves", moves, "Perturbed candidates in a batch")
      ->check(CLI::Range(1, 1000000));
  CLI11_PARSE(app, argc, argv);
  using namespace tether::problems;
  measure(pendulum(1, 1, 100, "index 1"), batches, moves);
  measure(pendulum(1, 1, 100, "index 0"), batches, moves);
  measure(car_axis("index 1"), batches, moves);
  measure(andrews("index 1"), batches, moves);
}
