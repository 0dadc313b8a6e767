// Tether: residual of large islands against time. SPDX-License-Identifier: BSD-3-Clause
//
//   islands [--contacts 1000,20000] [--families heap,wall] [--motions rest,hit,shaken]
//           [--mu 0.3,0.7,1] [--seed 1] [--sweeps 1000,10000] [--work 1e9,1e10] [--siconos SECONDS]
//           [--write FOLDER]
//
// A line of the table is an island. A cell is the residual that `evaluate` finds for the impulses,
// with the processor time of the solve in seconds: of sweeps alone, at most so many; of BodySolver;
// of Solver on the assembled problem; and of Siconos' best solver within the time limit. With a
// folder the problems are written there as .dat, too.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <limits>
#include <string>
#include <tether/contact/files.hpp>
#include <vector>

#include "islands/moved_islands.hpp"
#include "siconos.hpp"

using namespace tether::contact;

namespace {

constexpr double kTolerance = 1e-6;

struct Settings {
  std::vector<int> contacts = {1000, 10000}, sweeps = {1000, 10000};
  std::vector<std::string> families = random::families(), motions = {"rest", "hit", "shaken"};
  std::vector<double> mu = {0.3, 0.7, 1}, work = {1e9, 1e10};
  std::uint64_t seed = 1;
  double siconos = 0;
  std::string folder;
};

double processor_time() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void print_cell(double residual, double seconds) {
  std::printf(" %.1e (%.2f) |", residual, seconds);
  std::fflush(stdout);
}

void print_bodies(const random::Packing& island, const BodyOptions& options) {
  const double begin = processor_time();
  const BodySolution s = BodySolver(options).solve(island.bodies, island.contacts);
  const double seconds = processor_time() - begin;
  const Residuals r = evaluate(island.bodies, island.contacts, options.law, s.impulses);
  print_cell(r.fixed_point, seconds);
}

void print_assembled(const Problem& problem, double work) {
  Options o;
  o.law = Law::coulomb;
  o.tolerance = kTolerance;
  o.max_work = work;
  const double begin = processor_time();
  const Solution s = Solver(o).solve(problem);
  const double seconds = processor_time() - begin;
  print_cell(evaluate(problem, o.law, s.impulses).fixed_point, seconds);
}

void print_siconos(const Problem& problem, double time_limit) {
  double least = std::numeric_limits<double>::infinity(), seconds = time_limit;
  for (const std::string& solver : siconos_solvers()) {
    const SiconosRun run = run_siconos(solver, problem, false, kTolerance, time_limit);
    if (!run.finished) continue;
    const double residual = evaluate(problem, Law::coulomb, run.impulses).fixed_point;
    if (!(residual < least)) continue;
    least = residual;
    seconds = 1e-3 * run.milliseconds;
  }
  print_cell(least, seconds);
}

void print_line(const Settings& set, const std::string& family, int contacts, double mu,
                const std::string& motion) {
  const random::Packing island =
      random::moved_island(family, contacts, mu, random::motion(motion), set.seed);
  std::printf("| %s | %zu | %s | %g |", family.c_str(), island.contacts.size(), motion.c_str(), mu);
  BodyOptions o;
  o.law = Law::coulomb;
  o.tolerance = kTolerance;
  print_bodies(island, o);
  o.max_assembled = 0;
  for (const int sweeps : set.sweeps) {
    o.max_sweeps = sweeps;
    print_bodies(island, o);
  }
  const Problem problem = delassus(island.bodies, to_contacts(island.contacts));
  for (const double work : set.work) print_assembled(problem, work);
  if (set.siconos > 0) print_siconos(problem, set.siconos);
  std::printf("\n");
  if (set.folder.empty()) return;
  char name[128];
  std::snprintf(name, sizeof name, "/%s-%zu-%s-mu%g-seed%llu.dat", family.c_str(),
                island.contacts.size(), motion.c_str(), mu,
                static_cast<unsigned long long>(set.seed));
  write_dat(problem, set.folder + name);
}

void print_head(const Settings& set) {
  std::string head = "| island | contacts | motion | mu | BodySolver |",
              rule = "|---|---|---|---|---|";
  const auto add = [&](const std::string& column) {
    head += " " + column + " |";
    rule += "---|";
  };
  for (const int sweeps : set.sweeps) add(std::to_string(sweeps) + " sweeps");
  for (const double work : set.work) {
    char column[64];
    std::snprintf(column, sizeof column, "Solver, work %.0e", work);
    add(column);
  }
  if (set.siconos > 0) add("Siconos");
  std::printf("%s\n%s\n", head.c_str(), rule.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  use_one_thread(argv);
  Settings set;
  CLI::App app("Residual of large islands against time, at rest, hit and shaken");
  app.add_option("--contacts", set.contacts, "Sizes of the islands, about")
      ->delimiter(',')
      ->check(CLI::Range(10, 2000000));
  app.add_option("--families", set.families, "Kinds of islands")
      ->delimiter(',')
      ->check(CLI::IsMember(random::families()));
  app.add_option("--motions", set.motions, "rest, hit, shaken")
      ->delimiter(',')
      ->check(CLI::IsMember({"rest", "hit", "shaken"}));
  app.add_option("--mu", set.mu, "Coefficients of friction")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber);
  app.add_option("--sweeps", set.sweeps, "Limits of sweeps alone")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--work", set.work, "max_work of Solver")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--seed", set.seed, "Seed of the islands");
  app.add_option("--siconos", set.siconos, "Time limit of each solver of Siconos, s; 0: none")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--write", set.folder, "Folder for the problems")->check(CLI::ExistingDirectory);
  CLI11_PARSE(app, argc, argv);
  print_head(set);
  for (const std::string& family : set.families)
    for (const int contacts : set.contacts)
      for (const double mu : set.mu)
        for (const std::string& motion : set.motions) print_line(set, family, contacts, mu, motion);
  return 0;
}
