// Tether: every contact problem of a folder, with Siconos in the same run. SPDX-License-Identifier:
// BSD-3-Clause
//
//   contact_collection FOLDER [--law coulomb] [--tolerances 1e-3,1e-6,1e-9] [--csv FILE]
//                      [--permutations N] [--no-siconos] [--methods] [--time-limit s]
//
// CPU milliseconds: median over repeated cold solves, zero start. Ratio: ours / best Siconos
// solver.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "assemblies.hpp"
#include "siconos.hpp"
#include "timing.hpp"

using namespace tether::contact;

namespace {

int usage(const char* why) {
  std::fprintf(stderr,
               "contact_collection: %s\nusage: contact_collection FOLDER [--law LAW] "
               "[--tolerances 1e-3,1e-6,1e-9] [--csv FILE] [--permutations N] [--no-siconos] "
               "[--methods] [--time-limit SECONDS]\n",
               why);
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  use_one_thread(argv);
  std::string folder, csv;
  Law law = Law::coulomb;
  std::vector<double> tolerances{1e-3, 1e-6, 1e-9};
  int permutations = 0;
  bool siconos = has_siconos(), methods = false;
  double time_limit = 10;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    const auto value = [&] { return i + 1 < argc ? argv[++i] : ""; };
    if (option == "--law") {
      const std::string text = value();
      bool known = false;
      for (Law l : {Law::coulomb, Law::maximum_dissipation, Law::frictionless}) {
        if (text == name(l)) {
          law = l;
          known = true;
        }
      }
      if (!known) return usage("unknown law");
    } else if (option == "--tolerances") {
      tolerances.clear();
      std::istringstream list(value());
      for (std::string t; std::getline(list, t, ',');) tolerances.push_back(std::atof(t.c_str()));
    } else if (option == "--csv") {
      csv = value();
    } else if (option == "--permutations") {
      permutations = std::atoi(value());
    } else if (option == "--time-limit") {
      time_limit = std::atof(value());
    } else if (option == "--no-siconos") {
      siconos = false;
    } else if (option == "--methods") {
      methods = true;
    } else if (option[0] != '-' && folder.empty()) {
      folder = option;
    } else {
      return usage(("unknown option " + option).c_str());
    }
  }
  if (folder.empty()) return usage("a folder is needed");
  std::set<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string kind = entry.path().extension();
    if (kind == ".dat" || kind == ".hdf5") files.insert(entry.path());
  }
  if (files.empty()) return usage(("no problems in " + folder).c_str());
  std::FILE* table = csv.empty() ? nullptr : std::fopen(csv.c_str(), "w");
  if (!csv.empty() && !table) return usage(("cannot write " + csv).c_str());
  if (table)
    std::fprintf(table,
                 "problem,contacts,law,tolerance,measure,solver,status,sweeps,admm,factorisations,"
                 "replaced,ms,error,natural_map,natural_map_data,fixed_point,ratio\n");

  // Siconos is compared at its own measure; the last is the default.
  std::vector<Measure> measures{Measure::natural_map, Measure::natural_map_data,
                                Measure::fixed_point};
  if (law == Law::maximum_dissipation) measures = {Measure::fixed_point};
  siconos = siconos && law == Law::coulomb;
  int unsolved = 0, shuffled_failures = 0, shuffled_runs = 0, slower = 0;
  for (double tolerance : tolerances) {
    double log_ratio = 0;
    int ratios = 0;
    for (const std::string& file : files) {
      const std::string label = std::filesystem::path(file).filename();
      Problem problem;
      try {
        problem = read_problem(file);
      } catch (const std::exception& e) {
        std::printf("%s\n", e.what());
        ++unsolved;
        continue;
      }
      // Siconos first: its best time is what ours is compared with.
      double best = 0;
      std::string best_name = "-";
      if (siconos && problem.dimension() == 3) {
        for (const std::string& solver : siconos_solvers()) {
          for (bool dense : {false, true}) {
            if (dense && !siconos_is_tried_dense(solver, problem.contacts())) continue;
            const SiconosRun run = run_siconos(solver, problem, dense, tolerance, time_limit);
            if (!run.finished) continue;
            const Residuals r = evaluate(problem, law, run.impulses);
            const bool good = r.natural_map <= 1.001 * tolerance;
            if (table) {
              std::fprintf(
                  table,
                  "%s,%d,%s,%g,natural_map,siconos_%s,%s,%d,0,0,0,%.6g,%.3e,%.3e,%.3e,%.3e,\n",
                  label.c_str(), problem.contacts(), name(law), tolerance, run.solver.c_str(),
                  good ? "solved" : "failed", run.iterations, run.milliseconds, run.error,
                  r.natural_map, r.natural_map_data, r.fixed_point);
            }
            if (good && (best == 0 || run.milliseconds < best)) {
              best = run.milliseconds;
              best_name = run.solver;
            }
          }
        }
      }
      for (Measure measure : measures) {
        Options options;
        options.law = law;
        options.tolerance = tolerance;
        options.measure = measure;
        std::vector<Method> tried{Method::automatic};
        if (methods)
          tried = {Method::automatic, Method::gauss_seidel, Method::anderson, Method::admm,
                   Method::proximal_newton};
        for (Method method : tried) {
          options.method = method;
          options.max_work = method == Method::automatic ? Options().max_work : 1e9;
          Solution s;
          const double ms = timed(options, problem, s);
          const Residuals r = evaluate(problem, law, s.impulses);
          const bool compared =
              best > 0 && measure == Measure::natural_map && s.status == Status::solved;
          const double ratio = compared ? ms / best : 0;
          if (method == Method::automatic) {
            unsolved += s.status != Status::solved;
            if (compared) {
              log_ratio += std::log(ratio);
              ++ratios;
              slower += std::max(ms, best) > 0.05 && ratio > 1.2;
            }
          }
          std::printf(
              "%-44s %4d %-7g %-16s %-15s %-10s %10.5f ms  error %.2e  %d/%d/%d  replaced %zu",
              label.c_str(), problem.contacts(), tolerance, name(measure), name(method),
              name(s.status), ms, s.error, s.counts.sweeps, s.counts.admm_iterations,
              s.counts.factorisations, s.replaced.size());
          if (compared)
            std::printf("  best Siconos %s %.5f ms, ratio %.3f", best_name.c_str(), best, ratio);
          std::printf("\n");
          std::fflush(stdout);
          if (table) {
            std::fprintf(table, "%s,%d,%s,%g,%s,%s,%s,%d,%d,%d,%zu,%.6g,%.3e,%.3e,%.3e,%.3e,%.4g\n",
                         label.c_str(), problem.contacts(), name(law), tolerance, name(measure),
                         name(method), name(s.status), s.counts.sweeps, s.counts.admm_iterations,
                         s.counts.factorisations, s.replaced.size(), ms, s.error, r.natural_map,
                         r.natural_map_data, r.fixed_point, ratio);
            std::fflush(table);
          }
        }
        options.method = Method::automatic;
        options.max_work = Options().max_work;
        random::Generator generator(2024);
        std::vector<double> times;
        for (int k = 0; k < permutations; ++k) {
          const Problem q = random::shuffled(problem, generator);
          Solution s;
          const double begin = cpu_seconds();
          Solver(options).solve(q, s);
          times.push_back(1e3 * (cpu_seconds() - begin));
          ++shuffled_runs;
          if (s.status != Status::solved) {
            ++shuffled_failures;
            std::printf("  permutation %d of %s: %s, error %.2e\n", k, label.c_str(),
                        name(s.status), s.error);
          }
        }
        if (!times.empty()) {
          std::sort(times.begin(), times.end());
          std::printf("  permuted: median %.4f ms, most %.4f ms\n", times[times.size() / 2],
                      times.back());
        }
      }
    }
    if (ratios > 0)
      std::printf("tolerance %g: geometric mean ratio to the best Siconos solver %.4f over %d\n",
                  tolerance, std::exp(log_ratio / ratios), ratios);
  }
  std::printf(
      "unsolved %d; permuted: %d of %d failed; slower than 1.2 x Siconos above 0.05 ms: %d\n",
      unsolved, shuffled_failures, shuffled_runs, slower);
  if (table) std::fclose(table);
  return 0;
}
