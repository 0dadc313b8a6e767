// Tether: every contact problem of a folder, with Siconos in the same run. SPDX-License-Identifier:
// BSD-3-Clause
//
//   contact_collection FOLDER [--law coulomb] [--tolerances 1e-3,1e-6,1e-9] [--csv FILE]
//                      [--permutations N] [--no-siconos] [--time-limit s]
//
// CPU milliseconds: median over repeated cold solves, zero start. Ratio: ours / best Siconos
// solver.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "assemblies.hpp"
#include "siconos.hpp"
#include "timing.hpp"

using namespace tether::contact;

namespace {

struct Settings {
  std::string folder, csv;
  Law law = Law::coulomb;
  std::vector<double> tolerances{1e-3, 1e-6, 1e-9};
  int permutations = 0;
  bool siconos = has_siconos();
  double time_limit = 10;
};

// Rows of the CSV file, if one is wanted.
class Table {
 public:
  explicit Table(const std::string& file)
      : file_(file.empty() ? nullptr : std::fopen(file.c_str(), "w")) {
    if (!file.empty() && !file_) throw std::runtime_error("cannot write " + file);
    if (file_)
      std::fprintf(file_.get(),
                   "problem,contacts,law,tolerance,measure,solver,status,sweeps,factorisations,"
                   "replaced,ms,error,natural_map,fixed_point,ratio\n");
  }
  void add(const std::string& label, const Problem& problem, Law law, double tolerance,
           const SiconosRun& run, bool good, const Residuals& r) const {
    if (!file_) return;
    std::fprintf(file_.get(), "%s,%d,%s,%g,natural_map,siconos_%s,%s,%d,0,0,%.6g,%.3e,%.3e,%.3e,\n",
                 label.c_str(), problem.contacts(), name(law), tolerance, run.solver.c_str(),
                 good ? "solved" : "failed", run.iterations, run.milliseconds, run.error,
                 r.natural_map, r.fixed_point);
  }
  void add(const std::string& label, const Problem& problem, const Options& o, const Solution& s,
           double ms, const Residuals& r, double ratio) const {
    if (!file_) return;
    std::fprintf(file_.get(), "%s,%d,%s,%g,%s,tether,%s,%d,%d,%zu,%.6g,%.3e,%.3e,%.3e,%.4g\n",
                 label.c_str(), problem.contacts(), name(o.law), o.tolerance, name(o.measure),
                 name(s.status), s.counts.sweeps, s.counts.factorisations, s.replaced.size(), ms,
                 s.error, r.natural_map, r.fixed_point, ratio);
    std::fflush(file_.get());
  }

 private:
  struct Close {
    void operator()(std::FILE* f) const { std::fclose(f); }
  };
  std::unique_ptr<std::FILE, Close> file_;
};

struct Totals {
  int unsolved = 0, shuffled_failures = 0, shuffled_runs = 0, slower = 0, ratios = 0;
  double log_ratio = 0;
};

struct Best {
  double ms = 0;  // 0: none
  std::string solver = "-";
};

// The fastest of Siconos' solvers that reach the tolerance by the same natural map.
Best best_siconos(const Settings& settings, const std::string& label, const Problem& problem,
                  double tolerance, const Table& table) {
  Best best;
  for (const std::string& solver : siconos_solvers()) {
    for (bool dense : {false, true}) {
      if (dense && !siconos_is_tried_dense(solver, problem.contacts())) continue;
      const SiconosRun run = run_siconos(solver, problem, dense, tolerance, settings.time_limit);
      if (!run.finished) continue;
      const Residuals r = evaluate(problem, settings.law, run.impulses);
      const bool good = r.natural_map <= 1.001 * tolerance;
      table.add(label, problem, settings.law, tolerance, run, good, r);
      if (good && (best.ms == 0 || run.milliseconds < best.ms))
        best = {run.milliseconds, run.solver};
    }
  }
  return best;
}

void run_solver(const std::string& label, const Problem& problem, const Options& options,
                const Best& best, const Table& table, Totals& totals) {
  Solution s;
  const double ms = timed(options, problem, s);
  const Residuals r = evaluate(problem, options.law, s.impulses);
  const bool compared =
      best.ms > 0 && options.measure == Measure::natural_map && s.status == Status::solved;
  const double ratio = compared ? ms / best.ms : 0;
  totals.unsolved += s.status != Status::solved;
  if (compared) {
    totals.log_ratio += std::log(ratio);
    ++totals.ratios;
    totals.slower += std::max(ms, best.ms) > 0.05 && ratio > 1.2;
  }
  std::printf("%-44s %4d %-7g %-16s %-10s %10.5f ms  error %.2e  %d/%d  replaced %zu",
              label.c_str(), problem.contacts(), options.tolerance, name(options.measure),
              name(s.status), ms, s.error, s.counts.sweeps, s.counts.factorisations,
              s.replaced.size());
  if (compared)
    std::printf("  best Siconos %s %.5f ms, ratio %.3f", best.solver.c_str(), best.ms, ratio);
  std::printf("\n");
  std::fflush(stdout);
  table.add(label, problem, options, s, ms, r, ratio);
}

// The same problem with its contacts in other orders.
void run_permutations(const std::string& label, const Problem& problem, const Options& options,
                      int permutations, Totals& totals) {
  random::Generator generator(2024);
  std::vector<double> times;
  for (int k = 0; k < permutations; ++k) {
    const Problem q = random::shuffled(problem, generator);
    Solution s;
    const double begin = cpu_seconds();
    Solver(options).solve(q, s);
    times.push_back(1e3 * (cpu_seconds() - begin));
    ++totals.shuffled_runs;
    if (s.status == Status::solved) continue;
    ++totals.shuffled_failures;
    std::printf("  permutation %d of %s: %s, error %.2e\n", k, label.c_str(), name(s.status),
                s.error);
  }
  if (times.empty()) return;
  std::sort(times.begin(), times.end());
  std::printf("  permuted: median %.4f ms, most %.4f ms\n", times[times.size() / 2], times.back());
}

void run_problem(const Settings& settings, const std::string& file, double tolerance,
                 const Table& table, Totals& totals) {
  const std::string label = std::filesystem::path(file).filename();
  Problem problem;
  try {
    problem = read_problem(file);
  } catch (const std::exception& e) {
    std::printf("%s\n", e.what());
    ++totals.unsolved;
    return;
  }
  // Siconos is compared at its own measure; the last one is the default.
  std::vector<Measure> measures{Measure::natural_map, Measure::fixed_point};
  if (settings.law == Law::maximum_dissipation) measures = {Measure::fixed_point};
  Best best;
  if (settings.siconos && settings.law == Law::coulomb && problem.dimension() == 3)
    best = best_siconos(settings, label, problem, tolerance, table);
  for (Measure measure : measures) {
    Options options;
    options.law = settings.law;
    options.tolerance = tolerance;
    options.measure = measure;
    run_solver(label, problem, options, best, table, totals);
    run_permutations(label, problem, options, settings.permutations, totals);
  }
}

std::set<std::string> problems_of(const std::string& folder) {
  std::set<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string kind = entry.path().extension();
    if (kind == ".dat" || kind == ".hdf5") files.insert(entry.path());
  }
  if (files.empty()) throw std::runtime_error("no problems (.dat, .hdf5) in " + folder);
  return files;
}

int run(const Settings& settings) {
  const std::set<std::string> files = problems_of(settings.folder);
  const Table table(settings.csv);
  Totals totals;
  for (double tolerance : settings.tolerances) {
    totals.log_ratio = totals.ratios = 0;
    for (const std::string& file : files) run_problem(settings, file, tolerance, table, totals);
    if (totals.ratios > 0)
      std::printf("tolerance %g: geometric mean ratio to the best Siconos solver %.4f over %d\n",
                  tolerance, std::exp(totals.log_ratio / totals.ratios), totals.ratios);
  }
  std::printf(
      "unsolved %d; permuted: %d of %d failed; slower than 1.2 x Siconos above 0.05 ms: %d\n",
      totals.unsolved, totals.shuffled_failures, totals.shuffled_runs, totals.slower);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  use_one_thread(argv);
  Settings settings;
  bool no_siconos = false;
  std::map<std::string, Law> all_laws;
  for (Law law : laws()) all_laws[name(law)] = law;
  CLI::App app(
      "Every contact problem of a folder, beside Siconos' solvers where they are installed");
  app.add_option("folder", settings.folder, "Folder of .dat and .hdf5 files")->required();
  app.add_option("--law", settings.law, "Friction law")->transform(CLI::Transformer(all_laws));
  app.add_option("--tolerances", settings.tolerances, "1e-3,1e-6,1e-9")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--csv", settings.csv, "All runs as a table");
  app.add_option("--permutations", settings.permutations,
                 "Other orders of the contacts, each solved")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--time-limit", settings.time_limit, "Seconds for each of Siconos' solvers")
      ->check(CLI::PositiveNumber);
  app.add_flag("--no-siconos", no_siconos, "Without Siconos");
  CLI11_PARSE(app, argc, argv);
  settings.siconos = settings.siconos && !no_siconos;
  try {
    return run(settings);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "contact_collection: %s\n", e.what());
    return 2;
  }
}
