// Tether: what accuracy costs, for every problem, form and code. SPDX-License-Identifier:
// BSD-3-Clause
//
//   accuracy_cost [--problem P] [--tolerances 1e-3:1e-10] [--count N] [--peers a,b] [--csv F]
//                 [--svg DIR] [--json F] [--html F]
//
// Per problem: CPU at equal error of each code's best form. The ratio columns divide ours by the
// best form of plain IDA and of every peer at the same error.
#include <fmt/core.h>
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>

#include "measure.hpp"
#include "page.hpp"

using namespace tether::bench;

namespace {

constexpr double kLineWidth = 1.5;  // decades; see Curve::cpu_at

bool is_peer(const std::string& code) { return base_name(code) != "IDA" && !is_ours(code); }

std::string number(double value, const char* format = "{:.3g}") {
  return std::isnan(value) ? "-" : fmt::format(fmt::runtime(format), value);
}

/// Over all forms, with and without the algebraic variables in the error test ("s": without).
Best best_of(const std::vector<Family>& all, const std::string& base, double error) {
  Best found{std::nan(""), "-"};
  for (const Family& family : all) {
    if (base_name(family.code) != base) continue;
    const Best one = best(family.forms, error, kLineWidth);
    if (std::isnan(one.cpu) || one.cpu >= found.cpu) continue;
    found = {one.cpu, one.title + (family.code == base ? "" : " s")};
  }
  return found;
}

/// CPU at equal error: a line for each decade.
struct Comparison {
  Table table;
  std::map<std::string, GeometricMean> ratio;  ///< ours / that code
  std::map<std::string, int> ahead;            ///< decades at which that code is the faster one
};

Comparison compare(const std::vector<Point>& points, const std::vector<std::string>& peers) {
  const std::vector<Family> all = families(points);
  Comparison out;
  out.table.head = {"error", "Tether ms", "form", "plain IDA ms", "form", "ratio"};
  for (const std::string& peer : peers) {
    out.table.head.push_back(peer + " ms");
    out.table.head.push_back("ratio");
  }
  for (int decade = 3; decade <= 9; ++decade) {
    const double error = std::pow(10.0, -decade);
    const Best ours = best_of(all, "Tether", error), plain = best_of(all, "IDA", error);
    const auto note = [&](const std::string& code, double cpu) {
      const double ratio = ours.cpu / cpu;
      out.ratio[code].add(ratio);
      if (ratio > 1.0) ++out.ahead[code];
      return number(ratio, "{:.2f}");
    };
    std::vector<std::string> row = {fmt::format("{:.0e}", error), number(ours.cpu), ours.title,
                                    number(plain.cpu), plain.title};
    row.push_back(note("plain IDA", plain.cpu));
    for (const std::string& peer : peers) {
      const Best other = best_of(all, peer, error);
      row.push_back(number(other.cpu));
      row.push_back(note(peer, other.cpu));
    }
    out.table.rows.push_back(std::move(row));
  }
  return out;
}

Table failures(const std::vector<Point>& points) {
  Table table;
  table.head = {"code, form", "tolerance", "why"};
  for (const Point& point : points)
    if (is_ours(point.code) && !point.mark.empty())
      table.rows.push_back(
          {point.code + ", " + point.form, fmt::format("{:.1e}", point.tolerance), point.mark});
  return table;
}

Table work_at(const std::vector<Point>& points, double tolerance) {
  Table table;
  table.head = {"code, form", "error", "scd",    "steps",  "F",    "J",
                "LU",         "proj.", "failed", "CPU ms", "drift"};
  double nearest = 0.0;
  for (const Point& point : points)
    if (std::abs(std::log(point.tolerance / tolerance)) < std::abs(std::log(nearest / tolerance)))
      nearest = point.tolerance;
  for (const Point& p : points) {
    if (p.tolerance != nearest) continue;
    std::string drift;
    for (const auto& [name, value] : p.drift)
      drift += fmt::format("{}{} {:.0e}", drift.empty() ? "" : ", ", name, value);
    const bool failed = p.run.failed;
    table.rows.push_back(
        {p.code + ", " + p.form, failed ? "-" : fmt::format("{:.1e}", p.run.error),
         failed ? "-" : fmt::format("{:.1f}", p.scd), fmt::format("{}", p.run.steps),
         fmt::format("{}", p.run.residuals), fmt::format("{}", p.run.jacobians),
         fmt::format("{}", p.run.factorizations), fmt::format("{}", p.run.projections),
         fmt::format("{}", p.run.error_failures + p.run.solver_failures),
         fmt::format("{:.3g}", p.run.cpu_ms), failed ? p.run.message : drift});
  }
  return table;
}

std::string picture(const Case& which, const std::vector<Point>& points) {
  std::vector<Line> lines;
  for (const Point& point : points) {
    auto line = std::find_if(lines.begin(), lines.end(), [&](const Line& l) {
      return l.name == point.code && l.hint == point.code + ", " + point.form;
    });
    if (line == lines.end())
      line = lines.insert(lines.end(),
                          Line{point.code, point.code + ", " + point.form, {}, {}, false});
    if (!point.usable() || point.run.error > 1.0) continue;
    line->x.push_back(std::max(point.run.error, 1e-16));
    line->y.push_back(point.run.cpu_ms);
  }
  return svg(which.name + ": " + which.text, "end error (mixed)", "CPU ms", lines);
}

std::string csv_line(const Point& p) {
  std::string drift, orders;
  for (const auto& [name, value] : p.drift)
    drift += fmt::format("{}{}={:.3e}", drift.empty() ? "" : ";", name, value);
  for (std::size_t k = 0; k < p.orders.size(); ++k)
    if (p.orders[k] > 0)
      orders += fmt::format("{}{}:{}", orders.empty() ? "" : ";", k, p.orders[k]);
  return fmt::format("{},{},{},{:.4e},{:.4e},{:.2f},{:.5g},{},{},{},{},{},{},{},{},{},\"{}\"\n",
                     p.problem, p.code, p.form, p.tolerance, p.run.error, p.scd, p.run.cpu_ms,
                     p.run.steps, p.run.residuals, p.run.jacobians, p.run.factorizations,
                     p.run.projections, p.run.error_failures, p.run.solver_failures, drift, orders,
                     p.mark);
}

std::string json_point(const Point& p) {
  std::string drift, orders;
  for (const auto& [name, value] : p.drift)
    drift += (drift.empty() ? "" : ",") + json_string(name) + ":" + json_number(value);
  for (std::size_t k = 0; k < p.orders.size(); ++k)
    if (p.orders[k] > 0)
      orders += fmt::format("{}\"{}\":{}", orders.empty() ? "" : ",", k, p.orders[k]);
  return fmt::format(
      "{{\"problem\":{},\"code\":{},\"form\":{},\"tolerance\":{},\"error\":{},\"scd\":{},"
      "\"cpu_ms\":{},\"steps\":{},\"F\":{},\"J\":{},\"factorizations\":{},\"projections\":{},"
      "\"error_failures\":{},\"solver_failures\":{},\"drift\":{{{}}},\"orders\":{{{}}},\"mark\":{}}"
      "}",
      json_string(p.problem), json_string(p.code), json_string(p.form), json_number(p.tolerance),
      p.run.failed ? "null" : json_number(p.run.error), json_number(p.scd),
      json_number(p.run.cpu_ms), p.run.steps, p.run.residuals, p.run.jacobians,
      p.run.factorizations, p.run.projections, p.run.error_failures, p.run.solver_failures, drift,
      orders, json_string(p.mark));
}

struct Arguments {
  std::string problem, tolerances = "1e-3:1e-10", csv, svg, json, html;
  int count = 15, repeats = 3;
  double seconds = 2.0;
  std::vector<std::string> peers;
  bool no_watch = false, list = false, work = false;
};

void read(int argc, char** argv, CLI::App& app, Arguments& a) {
  app.add_option("--problem", a.problem, "Only problems whose name contains this");
  app.add_option("--tolerances", a.tolerances, "Loosest:tightest");
  app.add_option("--count", a.count, "Number of tolerances")->check(CLI::Range(3, 1000));
  app.add_option("--repeats", a.repeats, "Timed runs, of which the median counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--seconds", a.seconds, "CPU limit of one run")->check(CLI::PositiveNumber);
  app.add_option("--peers", a.peers, "Only these besides IDA and Tether; \"none\" for no peer")
      ->delimiter(',');
  app.add_option("--csv", a.csv, "One line for each run");
  app.add_option("--svg", a.svg, "Folder for pictures, error against time");
  app.add_option("--json", a.json, "All runs and ratios");
  app.add_option("--html", a.html, "Tables and pictures as a piece of a page");
  app.add_flag("--no-drift", a.no_watch, "Skip the untimed runs that follow drift and orders");
  app.add_flag("--work", a.work, "Also print the work of every code and form near tolerance 1e-6");
  app.add_flag("--list", a.list, "Print problems, forms and codes, and stop");
  app.parse(argc, argv);
}

Codes wanted_codes(const Arguments& arguments) {
  Codes wanted;
  for (auto& code : all_codes()) {
    const std::string name = code->name();
    const bool named = std::find(arguments.peers.begin(), arguments.peers.end(), base_name(name)) !=
                       arguments.peers.end();
    if (is_peer(name) && !arguments.peers.empty() && !named) continue;
    if (!code->missing().empty()) {
      fmt::print("{} left out: {}\n", name, code->missing());
      continue;
    }
    wanted.push_back(std::move(code));
  }
  return wanted;
}

void list(const std::vector<Case>& cases) {
  for (const Case& which : cases) {
    fmt::print("{}: {}\n ", which.name, which.text);
    for (const auto& form : which.forms) fmt::print(" \"{}\"", form.form);
    fmt::print("\n");
  }
  for (const auto& code : all_codes())
    fmt::print("{} ({}) {}\n", code->name(), code->version(), code->missing());
}

int run(const Arguments& arguments) {
  const std::size_t colon = arguments.tolerances.find(':');
  if (colon == std::string::npos)
    throw CLI::ValidationError("--tolerances", "want loosest:tightest, as in 1e-3:1e-10");
  const double loose = std::stod(arguments.tolerances.substr(0, colon));
  const double tight = std::stod(arguments.tolerances.substr(colon + 1));
  if (!(loose > 0.0 && tight > 0.0)) throw CLI::ValidationError("--tolerances", "want numbers > 0");

  const std::vector<Case> cases = catalogue();
  if (arguments.list) {
    list(cases);
    return 0;
  }
  const Codes codes = wanted_codes(arguments);
  std::vector<std::string> peers;
  std::string versions;
  for (const auto& code : codes) {
    const std::string base = base_name(code->name());
    if (is_peer(base) && std::find(peers.begin(), peers.end(), base) == peers.end())
      peers.push_back(base);
    versions += (versions.empty() ? "" : ",") + json_string(code->name()) + ":" +
                json_string(code->version());
  }
  const Plan plan{tolerance_ladder(loose, tight, arguments.count), arguments.repeats,
                  !arguments.no_watch, arguments.seconds, 300000};

  std::string csv =
      "problem,code,form,tolerance,error,scd,cpu_ms,steps,F,J,factorizations,projections,"
      "error_failures,solver_failures,drift,orders,mark\n";
  std::string html, json_points, json_ratios;
  std::map<std::string, GeometricMean> overall;
  std::map<std::string, int> ahead;
  int matched = 0;
  for (const Case& which : cases) {
    if (which.name.find(arguments.problem) == std::string::npos) continue;
    ++matched;
    const std::vector<Point> points = measure(which, codes, plan);
    const Comparison comparison = compare(points, peers);
    const Table marked = failures(points), work = work_at(points, 1e-6);
    fmt::print("{}: {}\n{}", which.name, which.text, comparison.table.text());
    if (arguments.work) fmt::print("\n{}", work.text());
    if (!marked.rows.empty()) fmt::print("ours beyond 100 tolerances:\n{}", marked.text());
    fmt::print("\n");
    std::fflush(stdout);
    for (const auto& [code, mean] : comparison.ratio) {
      overall[code].add(mean.value());
      json_ratios +=
          fmt::format("{}{{\"problem\":{},\"code\":{},\"mean\":{},\"largest\":{},\"decades\":{}}}",
                      json_ratios.empty() ? "" : ",\n", json_string(which.name), json_string(code),
                      json_number(mean.value()), json_number(mean.largest()), mean.count());
    }
    for (const auto& [code, count] : comparison.ahead) ahead[code] += count;
    const std::string image = picture(which, points);
    if (!arguments.svg.empty()) {
      std::string file = which.name;
      std::replace(file.begin(), file.end(), ' ', '_');
      mkdir(arguments.svg.c_str(), 0777);
      write_file(arguments.svg + "/" + file + ".svg", image);
    }
    html += fmt::format(
        "<h3>{}</h3>\n<p>{}</p>\n{}\n{}<details><summary>Work at 1e-6</summary>{}"
        "</details>\n",
        html_escape(which.name), html_escape(which.text), image, comparison.table.html(),
        work.html());
    if (!marked.rows.empty())
      html +=
          "<details><summary>Ours beyond 100 tolerances</summary>" + marked.html() + "</details>\n";
    for (const Point& point : points) {
      csv += csv_line(point);
      json_points += (json_points.empty() ? "" : ",\n") + json_point(point);
    }
  }
  if (matched == 0) {
    fmt::print(stderr, "no problem's name contains \"{}\"; --list shows them\n", arguments.problem);
    return 2;
  }

  Table summary;
  summary.head = {"ours / its best form", "geometric mean", "worst problem", "decades it leads"};
  for (const auto& [code, mean] : overall)
    summary.rows.push_back({code, number(mean.value(), "{:.2f}"), number(mean.largest(), "{:.2f}"),
                            fmt::format("{}", ahead[code])});
  fmt::print("CPU at equal error, 1e-3 to 1e-9, all problems\n{}", summary.text());
  html = "<h2>Error against time</h2>\n" + summary.html() + html;
  if (!arguments.csv.empty()) write_file(arguments.csv, csv);
  if (!arguments.html.empty()) write_file(arguments.html, html);
  if (!arguments.json.empty())
    write_file(arguments.json, "{\"versions\":{" + versions + "},\n\"ratios\":[" + json_ratios +
                                   "],\n\"runs\":[" + json_points + "]}\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Error against time of Tether, plain IDA and peers");
  Arguments arguments;
  try {
    read(argc, argv, app, arguments);
    return run(arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    fmt::print(stderr, "accuracy_cost: {}\n", error.what());
    return 1;
  }
}
