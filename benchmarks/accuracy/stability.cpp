// Tether: computational stability, how smoothly errors and steps follow the tolerance.
// SPDX-License-Identifier: BSD-3-Clause
//
//   stability [--problem P,Q] [--skip R] [--form F] [--count 100] [--csv F] [--json F] [--html F]
//
// Scatter: rms distance of log10(end error) and of log10(steps) from their least-squares lines over
// log10(tolerance). Slope 1: the error is proportional to the tolerance. CPU: geometric mean of the
// ratio to plain IDA at the same tolerance.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "catalogue.hpp"
#include "code.hpp"
#include "page.hpp"
#include "projection/curve.hpp"

using namespace tether::bench;
using tether::problems::Problem;

namespace {

struct Trend {
  double slope = std::nan(""), scatter = std::nan("");
};

Trend trend(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  if (x.size() < 3) return {};
  double mx = 0, my = 0, sxx = 0, sxy = 0, rest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) mx += x[i] / n, my += y[i] / n;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sxx += (x[i] - mx) * (x[i] - mx);
    sxy += (x[i] - mx) * (y[i] - my);
  }
  const double slope = sxy / sxx;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double d = y[i] - my - slope * (x[i] - mx);
    rest += d * d / n;
  }
  return {slope, std::sqrt(rest)};
}

struct Sweep {
  std::string code;
  std::vector<double> log_tolerance, log_error, log_steps;
  GeometricMean cpu;  ///< to plain IDA
  int failures = 0;
  Trend error() const { return trend(log_tolerance, log_error); }
  Trend steps() const { return trend(log_tolerance, log_steps); }
};

std::vector<Sweep> sweep(const Problem& problem, const Codes& codes,
                         const std::vector<double>& tolerances, int repeats) {
  std::vector<Sweep> sweeps;
  for (const auto& code : codes) sweeps.push_back({code->name(), {}, {}, {}, {}, 0});
  const Limits limits{300000, 1.0};  // steps, CPU seconds
  for (const double tolerance : tolerances) {
    std::vector<double> fastest(codes.size(), std::nan(""));
    for (int repeat = 0; repeat < repeats; ++repeat) {
      for (std::size_t k = 0; k < codes.size(); ++k) {
        if (!codes[k]->refuses(problem).empty()) continue;
        const Run run = codes[k]->run(problem, tolerance, limits);
        const bool usable = !run.failed && run.error > 0.0;
        if (usable && !(run.cpu_ms >= fastest[k])) fastest[k] = run.cpu_ms;
        if (repeat > 0) continue;
        if (!usable) {
          ++sweeps[k].failures;
          continue;
        }
        sweeps[k].log_tolerance.push_back(std::log10(tolerance));
        sweeps[k].log_error.push_back(std::log10(run.error));
        sweeps[k].log_steps.push_back(std::log10(static_cast<double>(run.steps)));
      }
    }
    for (std::size_t k = 0; k < codes.size(); ++k) sweeps[k].cpu.add(fastest[k] / fastest[0]);
  }
  return sweeps;
}

std::vector<double> powers(std::vector<double> exponents) {
  for (double& value : exponents) value = std::pow(10.0, value);
  return exponents;
}

std::string number(double value, const char* format) {
  return std::isnan(value) ? "-" : fmt::format(fmt::runtime(format), value);
}

// With smoothing at most a fifth of plain IDA's scatter of errors at 1.25 times the CPU; without at
// most that of plain IDA.
std::string goal(const Sweep& s, const Sweep& plain) {
  if (s.code != "Tether" && s.code != "Tether smooth") return "";
  const bool smooth = s.code == "Tether smooth";
  const double scatter = s.error().scatter / plain.error().scatter, cpu = s.cpu.value();
  if (!(scatter <= (smooth ? 0.2 : 1.0))) return "misses: scatter";
  return smooth && !(cpu <= 1.25) ? "misses: CPU" : "met";
}

// The form in which each problem is usually given to IDA; all when --form asks.
bool wanted(const Problem& problem, const std::string& form, const Case& which) {
  if (!form.empty()) return problem.form == form || (form == "all" && problem.index <= 2);
  return problem.form == which.forms.front().form;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Scatter of error and steps over many tolerances");
  std::vector<std::string> only, skip;
  std::string form, csv, json, html;
  int count = 100, repeats = 1;
  double loose = 1e-4, tight = 1e-9;
  app.add_option("--problem", only, "Only problems whose name contains one of these")
      ->delimiter(',');
  app.add_option("--skip", skip, "No problems whose name contains one of these")->delimiter(',');
  app.add_option("--form", form, "This form, or \"all\"; otherwise each problem's first");
  app.add_option("--count", count, "Number of tolerances")->check(CLI::Range(3, 10000));
  app.add_option("--loose", loose, "Largest tolerance")->check(CLI::PositiveNumber);
  app.add_option("--tight", tight, "Smallest tolerance")->check(CLI::PositiveNumber);
  app.add_option("--repeats", repeats, "Runs of which the fastest counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--csv", csv, "One line for each problem and code");
  app.add_option("--json", json, "The same as JSON");
  app.add_option("--html", html, "Table and pictures as a piece of a page");
  CLI11_PARSE(app, argc, argv);

  Codes codes;
  add_ida_codes(codes);
  Table table;
  table.head = {"problem, form", "code",        "error scatter", "slope",  "steps scatter",
                "/ IDA error",   "/ IDA steps", "CPU / IDA",     "failed", "goal"};
  std::string pictures,
      lines = "problem,form,code,error_scatter,slope,steps_scatter,cpu,failures\n";
  Json items = Json::array();
  std::vector<Case> cases;
  try {
    cases = selected(catalogue(), only, skip);
  } catch (const std::exception& error) {
    fmt::print(stderr, "stability: {}\n", error.what());
    return 2;
  }
  for (const Case& which : cases) {
    for (const Problem& problem : which.forms) {
      if (!wanted(problem, form, which)) continue;
      const std::vector<Sweep> sweeps =
          sweep(problem, codes, tolerance_ladder(loose, tight, count), repeats);
      std::vector<Line> points;
      for (const Sweep& s : sweeps) {
        if (s.log_error.empty() && s.failures == 0) continue;
        const Trend error = s.error(), steps = s.steps(), plain_error = sweeps[0].error(),
                    plain_steps = sweeps[0].steps();
        const bool plain = s.code == sweeps[0].code;
        table.rows.push_back(
            {which.name + ", " + problem.form, s.code, number(error.scatter, "{:.3f}"),
             number(error.slope, "{:.2f}"), number(steps.scatter, "{:.4f}"),
             plain ? "1" : number(error.scatter / plain_error.scatter, "{:.2f}"),
             plain ? "1" : number(steps.scatter / plain_steps.scatter, "{:.2f}"),
             number(s.cpu.value(), "{:.2f}"), fmt::format("{}", s.failures), goal(s, sweeps[0])});
        lines += fmt::format("{},{},{},{:.5g},{:.5g},{:.5g},{:.5g},{}\n", which.name, problem.form,
                             s.code, error.scatter, error.slope, steps.scatter, s.cpu.value(),
                             s.failures);
        items.push_back({{"problem", which.name},
                         {"form", problem.form},
                         {"code", s.code},
                         {"error_scatter", error.scatter},
                         {"slope", error.slope},
                         {"steps_scatter", steps.scatter},
                         {"cpu", s.cpu.value()},
                         {"failures", s.failures}});
        points.push_back(
            {s.code, problem.form, powers(s.log_tolerance), powers(s.log_error), true});
      }
      pictures += svg(which.name + ", " + problem.form, "tolerance", "end error (mixed)", points);
    }
  }
  if (table.rows.empty()) {
    fmt::print(stderr, "no problem and form of that name\n");
    return 2;
  }
  fmt::print("{}", table.text());
  try {
    if (!csv.empty()) write_file(csv, lines);
    if (!json.empty()) write_json(json, items);
    if (!html.empty())
      write_file(html, "<h2>Computational stability</h2>\n" + table.html() + pictures);
  } catch (const std::exception& error) {
    fmt::print(stderr, "stability: {}\n", error.what());
    return 1;
  }
}
