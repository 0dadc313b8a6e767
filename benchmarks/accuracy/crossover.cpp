// Tether: where RADAU5's ground ends. SPDX-License-Identifier: BSD-3-Clause
//
//   crossover [--part unknowns,cost,restarts,tight] [--repeats 3]
//
// Processor time at equal end error of "Tether fast" over that of RADAU5, where a fifth-order
// one-step code leads: small smooth systems. `unknowns`: copies from different starts side by side
// in one dense system. `cost`: time and evaluations of F tell from which cost of F on we lead.
// `restarts`: the interval in pieces, each begun anew, as after discontinuities. `tight`: errors
// down to 1e-11. Times are the least of the repeats, at an error from least-squares lines over
// half-decades of tolerance.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <problems/kepler.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/rigid_body.hpp>

#include "code.hpp"
#include "projection/curve.hpp"
#include "rows_of.hpp"

using namespace tether;
using namespace tether::bench;
using problems::Problem;

namespace {

constexpr double kWidth = 1.5;  // decades of error: accuracy_cost's

/// Systems that know nothing of each other as one; every component is compared.
Problem side_by_side(const std::vector<Problem>& parts) {
  Problem all = parts.front();
  all.size = 0;
  for (auto* entries : {&all.y0, &all.yp0, &all.id, &all.reference}) entries->clear();
  const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  int count = 0;
  std::vector<ida_projection::Constraints> rows;
  for (const Problem& part : parts) {
    append(all.y0, part.y0);
    append(all.yp0, part.yp0);
    append(all.id, part.id);
    append(all.reference, part.reference);
    all.size += part.size;
    rows.push_back(part.recommended_constraints());
    count += rows.back().total_count();
  }
  all.error_components = all.size;
  all.jacobian = nullptr;
  all.atol_scale.clear();
  all.residual = [parts](double t, const double* y, const double* yp, double* r) {
    for (const Problem& part : parts) {
      part.residual(t, y, yp, r);
      y += part.size, yp += part.size, r += part.size;
    }
  };
  ida_projection::Constraints joined;
  joined.count = count;
  joined.value = [parts, rows](double t, ida_projection::ConstVector y, ida_projection::Vector g) {
    Eigen::Index column = 0, row = 0;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      each_part(rows[k], [&](const ida_projection::Constraints& set, Eigen::Index) {
        set.value(t, ida_projection::ConstVector(y.data() + column, parts[k].size),
                  ida_projection::Vector(g.data() + row, set.count));
        row += set.count;
      });
      column += parts[k].size;
    }
  };
  struct Work {
    Eigen::VectorXd y, g;
    RowMajor C;
  };
  std::vector<Work> works;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const int m = rows[k].total_count(), n = parts[k].size;
    works.push_back({Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(m), RowMajor::Zero(m, n)});
  }
  joined.jacobian = ida_projection::DenseJacobian(
      [rows, works](double t, ida_projection::ConstVector y, ida_projection::Matrix C) mutable {
        Eigen::Index column = 0, row = 0;
        for (std::size_t k = 0; k < works.size(); ++k) {
          Work& work = works[k];
          work.y = y.segment(column, work.y.size());
          evaluate_rows(rows[k], t, work.y, work.g, work.C);
          C.block(row, column, work.C.rows(), work.C.cols()) = work.C;
          row += work.C.rows(), column += work.C.cols();
        }
      });
  all.rows = {{"all", joined}};
  all.recommended = {"all"};
  return all;
}

/// The run in so many pieces of an ordinary differential equation y' = f, begun anew each time.
Run in_pieces(const Code& code, Problem problem, double tolerance, int pieces) {
  const double begin = problem.t0, length = problem.t_end - problem.t0;
  const Limits limits{300000, 2.0};
  Run sum;
  for (int k = 0; k < pieces; ++k) {
    problem.t0 = begin + length * k / pieces;
    problem.t_end = begin + length * (k + 1) / pieces;
    if (k > 0) {
      const std::vector<double> zero(problem.y0.size(), 0.0);
      problem.y0 = sum.y;
      problem.residual(problem.t0, problem.y0.data(), zero.data(), problem.yp0.data());
      for (double& slope : problem.yp0) slope = -slope;
    }
    const Run run = code.run(problem, tolerance, limits, {});
    sum.y = run.y;
    sum.error = run.error;
    sum.cpu_ms += run.cpu_ms;
    sum.residuals += run.residuals;
    sum.steps += run.steps;
    if ((sum.failed = run.failed)) break;
  }
  return sum;
}

struct Sweep {
  Curve cpu, evaluations;
};

std::vector<Sweep> sweep(const Problem& problem, const Codes& codes, double tight, int pieces,
                         int repeats) {
  std::vector<Sweep> sweeps(codes.size());
  const int count = 1 + static_cast<int>(std::lround(2.0 * std::log10(1e-2 / tight)));
  for (const double tolerance : tolerance_ladder(1e-2, tight, count)) {
    std::vector<Run> least(codes.size());
    for (int repeat = 0; repeat < repeats; ++repeat)
      for (std::size_t k = 0; k < codes.size(); ++k) {
        const Run run = in_pieces(*codes[k], problem, tolerance, pieces);
        if (repeat == 0 || run.cpu_ms < least[k].cpu_ms) least[k] = run;
      }
    for (std::size_t k = 0; k < codes.size(); ++k) {
      sweeps[k].cpu.add(least[k].failed, least[k].error, least[k].cpu_ms);
      sweeps[k].evaluations.add(least[k].failed, least[k].error,
                                static_cast<double>(least[k].residuals));
    }
  }
  return sweeps;
}

void print_head(const std::string& title, const std::vector<double>& errors) {
  fmt::print("\n## {}\n\n| |", title);
  for (const double error : errors) fmt::print(" error {:.0e} |", error);
  fmt::print("\n|---|");
  for (std::size_t k = 0; k < errors.size(); ++k) fmt::print("---|");
  fmt::print("\n");
}

/// Ours, RADAU5's and their ratio at these errors.
void print_line(const std::string& title, const std::vector<Sweep>& of,
                const std::vector<double>& errors) {
  fmt::print("| {} |", title);
  for (const double error : errors) {
    const double ours = of[0].cpu.cpu_at(error, kWidth), theirs = of[1].cpu.cpu_at(error, kWidth);
    fmt::print(" {:.2f} ({:.3g}, {:.3g} ms; F {:.0f}, {:.0f}) |", ours / theirs, ours, theirs,
               of[0].evaluations.cpu_at(error, kWidth), of[1].evaluations.cpu_at(error, kWidth));
  }
  fmt::print("\n");
  std::fflush(stdout);
}

/// The cost of F, beyond what it costs here, from which on we are faster.
void print_cost(const std::string& title, const std::vector<Sweep>& of,
                const std::vector<double>& errors) {
  fmt::print("| {} |", title);
  for (const double error : errors) {
    const double time = of[0].cpu.cpu_at(error, kWidth) - of[1].cpu.cpu_at(error, kWidth);
    const double fewer =
        of[1].evaluations.cpu_at(error, kWidth) - of[0].evaluations.cpu_at(error, kWidth);
    if (fewer > 0.0)
      fmt::print(" {:.2f} us ({:.2f} of its F) |", std::max(0.0, 1e3 * time / fewer),
                 1.0 - fewer / of[1].evaluations.cpu_at(error, kWidth));
    else
      fmt::print(" never (ours are {:.2f} of its F) |",
                 1.0 - fewer / of[1].evaluations.cpu_at(error, kWidth));
  }
  fmt::print("\n");
  std::fflush(stdout);
}

Problem copies(const std::string& name, int count) {
  std::vector<Problem> parts;
  for (int k = 0; k < count; ++k) {
    const double s = static_cast<double>(k) / count;
    if (name == "Lotka-Volterra") parts.push_back(problems::lotka_volterra(2.0 - s, 0.5, 100.0));
    if (name == "Kepler") parts.push_back(problems::kepler(0.6 - 0.3 * s, 100.0));
    if (name == "rigid body") {
      parts.push_back(problems::rigid_body("dzhanibekov", 100.0));
    }
    if (name == "pendulum, index 1 x2")
      parts.push_back(problems::pendulum(1.0 + s, 9.81, 10.0, "index 1 x2"));
  }
  if (count == 1) return parts.front();
  return side_by_side(parts);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Where RADAU5's ground ends");
  std::vector<std::string> parts = {"unknowns", "cost", "restarts", "tight"};
  int repeats = 3;
  app.add_option("--part", parts, "unknowns, cost, restarts, tight")->delimiter(',');
  app.add_option("--repeats", repeats, "runs of each; the least time counts")
      ->check(CLI::Range(1, 99));
  CLI11_PARSE(app, argc, argv);
  Codes every = all_codes(), codes;
  for (const char* name : {"Tether fast", "RADAU5"})
    for (auto& code : every)
      if (code && code->name() == name) codes.push_back(std::move(code));
  if (codes.size() != 2 || !codes[1]->missing().empty()) {
    fmt::print("crossover is skipped: RADAU5 {}\n", codes.back()->missing());
    return 0;
  }
  const auto wants = [&](const char* part) {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  };
  const std::vector<double> errors = {1e-3, 1e-5, 1e-7};
  const std::vector<std::string> names = {"Lotka-Volterra", "Kepler", "rigid body",
                                          "pendulum, index 1 x2"};
  if (wants("unknowns")) {
    print_head("By copies side by side", errors);
    for (const auto& [name, most] : {std::pair("Lotka-Volterra", 32), std::pair("Kepler", 16),
                                     std::pair("pendulum, index 1 x2", 12)})
      for (int count = 1; count <= most; count *= 2) {
        const Problem problem = copies(name, count);
        print_line(fmt::format("{} x {}, N = {}", count, name, problem.size),
                   sweep(problem, codes, 1e-11, 1, count > 4 ? 1 : repeats), errors);
      }
  }
  if (wants("cost")) {
    print_head("Cost of F from which on Tether leads", errors);
    for (const std::string& name : names)
      print_cost(name, sweep(copies(name, 1), codes, 1e-12, 1, repeats), errors);
  }
  if (wants("restarts")) {
    print_head("In pieces, each begun anew", errors);
    for (const char* name : {"Lotka-Volterra", "Kepler", "rigid body"})
      for (const int pieces : {1, 4, 16, 64})
        print_line(fmt::format("{}, {} pieces", name, pieces),
                   sweep(copies(name, 1), codes, 1e-12, pieces, repeats), errors);
  }
  if (wants("tight")) {
    const std::vector<double> tight = {1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11};
    print_head("At small errors", tight);
    for (const std::string& name : names)
      print_line(name, sweep(copies(name, 1), codes, 1e-13, 1, repeats), tight);
  }
  return 0;
}
