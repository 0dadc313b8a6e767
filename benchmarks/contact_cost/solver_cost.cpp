// Tether: error against time of contact solvers. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "accuracy/page.hpp"
#include "contact/siconos.hpp"
#include "contact/timing.hpp"
#include "projection/curve.hpp"
#include "report.hpp"

namespace tether::bench {

namespace {

using contact::Law;

struct Run {
  std::string problem, solver;
  int contacts = 0;
  Law law = Law::coulomb;
  double tolerance = 0, ms = 0, error = 0;
  std::string status;
  bool solved = false;
};

const char* const kOurs = "tether";
const char* const kBest = "best of Siconos";

// The same yardstick for everybody: the natural map over max(|b|, |x|, |w|) under `coulomb`, which
// is what Siconos stops on, and the block fixed point over |b| under `maximum_dissipation`.
double error_of(const contact::Problem& problem, Law law, const Eigen::VectorXd& impulses) {
  const contact::Residuals r = contact::evaluate(problem, law, impulses);
  return law == Law::coulomb ? r.natural_map : r.fixed_point;
}

class Comparison {
 public:
  explicit Comparison(const SolverPlan& plan) : plan_(plan) {}

  void ours(const std::string& name, const contact::Problem& problem, Law law) {
    int unsolved = 0;
    for (const double tolerance : plan_.tolerances) {
      if (unsolved == 2) break;  // it will not reach tighter ones
      contact::Options options;
      options.law = law;
      // Siconos stops by its natural map, which depends on units: ours does here, too.
      if (law == Law::coulomb) options.measure = contact::Measure::natural_map;
      options.tolerance = tolerance;
      options.max_work = 1e9 * plan_.limit;
      contact::Solution s;
      const double ms = contact::timed(options, problem, s, std::min(0.01, 0.1 * plan_.limit));
      const bool solved = s.status == contact::Status::solved;
      unsolved += !solved;
      runs.push_back({name, kOurs, problem.contacts(), law, tolerance, ms,
                      error_of(problem, law, s.impulses), contact::name(s.status), solved});
    }
  }

  void siconos(const std::string& name, const contact::Problem& problem) {
    if (!plan_.siconos || problem.dimension() != 3) return;
    std::map<double, Run> best;
    for (const std::string& solver : contact::siconos_solvers()) {
      for (const bool dense : {false, true}) {
        if (dense && !contact::siconos_is_tried_dense(solver, problem.contacts())) continue;
        for (const double tolerance : plan_.tolerances) {
          const contact::SiconosRun run =
              contact::run_siconos(solver, problem, dense, tolerance, plan_.limit);
          Run out{name,
                  "Siconos " + run.solver,
                  problem.contacts(),
                  Law::coulomb,
                  tolerance,
                  run.milliseconds,
                  NAN,
                  "limit",
                  false};
          if (run.finished) {
            out.error = error_of(problem, Law::coulomb, run.impulses);
            out.solved = out.error <= 1.001 * tolerance;
            out.status = out.solved ? "solved" : "failed";
          }
          runs.push_back(out);
          if (!out.solved) break;
          const auto found = best.find(tolerance);
          if (found == best.end() || out.ms < found->second.ms) best[tolerance] = out;
        }
      }
    }
    for (auto& [tolerance, run] : best) {
      run.status = "solved by " + run.solver.substr(8);
      run.solver = kBest;
      runs.push_back(run);
    }
  }

  std::vector<Run> runs;

 private:
  const SolverPlan& plan_;
};

// Solved problems, and time over ours where both solved it.
Table summary(const std::vector<Run>& runs, Law law, const std::vector<double>& tolerances) {
  std::map<std::pair<std::string, double>, const Run*> ours;
  std::set<std::string> problems;
  for (const Run& r : runs) {
    if (r.law != law) continue;
    problems.insert(r.problem);
    if (r.solver == kOurs) ours[{r.problem, r.tolerance}] = &r;
  }
  Table table;
  table.head = {fmt::format("{}: solved, time / tether", name(law))};
  for (const double t : tolerances) table.head.push_back(fmt::format("{:.0e}", t));
  for (const std::string solver : {kOurs, kBest}) {
    std::vector<std::string> row{solver};
    bool any = false;
    for (const double t : tolerances) {
      int solved = 0;
      GeometricMean ratio;
      for (const Run& r : runs) {
        if (r.law != law || r.solver != solver || r.tolerance != t || !r.solved) continue;
        ++solved;
        const auto own = ours.find({r.problem, t});
        if (own != ours.end() && own->second->solved) ratio.add(r.ms / own->second->ms);
      }
      any = any || solved > 0;
      row.push_back(ratio.count()
                        ? fmt::format("{} of {}, {:.2f}", solved, problems.size(), ratio.value())
                        : fmt::format("{} of {}", solved, problems.size()));
    }
    if (any) table.rows.push_back(row);
  }
  return table;
}

std::string picture(const std::vector<Run>& runs, const std::string& problem, Law law) {
  std::vector<Line> lines;
  std::string title;
  for (const Run& r : runs) {
    const bool one_of_siconos = r.solver.rfind("Siconos ", 0) == 0;
    if (r.problem != problem || r.law != law || one_of_siconos || !r.solved) continue;
    title = fmt::format("{}, {} contacts, {}", problem, r.contacts, name(law));
    if (lines.empty() || lines.back().name != r.solver) lines.push_back({r.solver, "", {}, {}});
    lines.back().x.push_back(r.ms);
    // Exact to the last bit has no logarithm.
    lines.back().y.push_back(std::max(r.error, 1e-17));
  }
  return svg(title, "CPU / ms", law == Law::coulomb ? "natural map" : "block fixed point", lines);
}

std::string csv(const std::vector<Run>& runs) {
  std::string out = "problem,contacts,law,solver,tolerance,status,ms,error\n";
  for (const Run& r : runs)
    out += fmt::format("{},{},{},{},{:g},{},{:.6g},{:.3e}\n", r.problem, r.contacts, name(r.law),
                       r.solver, r.tolerance, r.status, r.ms, r.error);
  return out;
}

Json json(const std::vector<Run>& runs) {
  Json out = Json::array();
  for (const Run& r : runs)
    out.push_back({{"problem", r.problem},
                   {"contacts", r.contacts},
                   {"law", name(r.law)},
                   {"solver", r.solver},
                   {"tolerance", r.tolerance},
                   {"status", r.status},
                   {"ms", r.ms},
                   {"error", r.error}});
  return out;
}

std::vector<std::filesystem::path> files_of(const std::string& folder) {
  std::set<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (entry.path().extension() == ".dat" || entry.path().extension() == ".hdf5")
      files.insert(entry.path());
  if (files.empty()) throw std::runtime_error("no .dat or .hdf5 problems in " + folder);
  return {files.begin(), files.end()};
}

}  // namespace

Report solver_cost(const SolverPlan& plan) {
  Report report;
  Comparison comparison(plan);
  std::vector<std::string> names;
  if (plan.siconos && !contact::has_siconos())
    report.text += "Siconos left out: not installed (libsiconos-numerics-dev)\n";
  for (const auto& file : files_of(plan.folder)) {
    contact::Problem problem;
    try {
      problem = contact::read_problem(file);
    } catch (const std::exception& e) {
      report.text += fmt::format("left out: {}\n", e.what());
      continue;
    }
    names.push_back(file.filename());
    comparison.ours(names.back(), problem, Law::coulomb);
    comparison.siconos(names.back(), problem);
    comparison.ours(names.back(), problem, Law::maximum_dissipation);
  }
  const std::vector<Run>& runs = comparison.runs;
  for (const Law law : {Law::coulomb, Law::maximum_dissipation}) {
    const Table table = summary(runs, law, plan.tolerances);
    report.text += table.text() + "\n";
    report.html += table.html();
    for (const std::string& problem : names)
      report.pictures.emplace_back(problem + "_" + name(law), picture(runs, problem, law));
  }
  report.csv = csv(runs);
  report.json = json(runs);
  return report;
}

}  // namespace tether::bench
