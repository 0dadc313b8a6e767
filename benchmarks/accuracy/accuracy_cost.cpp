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

#include "report.hpp"

using namespace tether::bench;

namespace {

struct Arguments {
  std::string tolerances = "1e-3:1e-10", csv, svg, json, html;
  int count = 15, repeats = 3;
  double seconds = 2.0;
  std::vector<std::string> problems, skip, peers;
  bool no_watch = false, no_reach = false, list = false, work = false;
};

void read(int argc, char** argv, CLI::App& app, Arguments& a) {
  app.add_option("--problem", a.problems, "Only problems whose name contains one of these")
      ->delimiter(',');
  app.add_option("--skip", a.skip, "No problems whose name contains one of these")->delimiter(',');
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
  app.add_flag("--no-reach", a.no_reach,
               "Only these tolerances, even where end errors do not "
               "cover 1e-3 to 1e-9");
  app.add_flag("--work", a.work, "Also print the work of every code and form near tolerance 1e-6");
  app.add_flag("--list", a.list, "Print problems, forms and codes, and stop");
  app.parse(argc, argv);
}

// "1e-3:1e-10"; says what it got and what it wants.
std::pair<double, double> range(const std::string& text) {
  double loose = 0.0, tight = 0.0;
  char colon = 0, rest = 0;
  const int read = std::sscanf(text.c_str(), "%lf%c%lf%c", &loose, &colon, &tight, &rest);
  if (read != 3 || colon != ':' || !(loose < 1.0 && loose >= tight && tight >= 1e-14))
    throw CLI::ValidationError("--tolerances", "got \"" + text +
                                                   "\"; want loosest:tightest, 1 > loosest >= "
                                                   "tightest >= 1e-14, as in 1e-3:1e-10");
  return {loose, tight};
}

Codes wanted_codes(const std::vector<std::string>& names) {
  Codes wanted, all = all_codes();
  std::string known = "none";
  for (const auto& code : all)
    if (is_peer(code->name()) && base_name(code->name()) == code->name())
      known += ", " + code->name();
  for (const std::string& name : names) {
    const auto is = [&](const auto& code) {
      return is_peer(code->name()) && base_name(code->name()) == name;
    };
    if (name != "none" && std::none_of(all.begin(), all.end(), is))
      throw CLI::ValidationError("--peers", "no peer \"" + name + "\"; there are " + known);
  }
  for (auto& code : all) {
    const std::string name = code->name();
    if (is_peer(name) && !names.empty() &&
        std::find(names.begin(), names.end(), base_name(name)) == names.end())
      continue;
    if (!code->missing().empty()) {
      if (name == base_name(name)) fmt::print("{} left out: {}\n", name, code->missing());
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

// Fails before the runs rather than after them.
void check_writable(const Arguments& a) {
  if (!a.svg.empty()) mkdir(a.svg.c_str(), 0777);
  for (const std::string& file : {a.csv, a.json, a.html, a.svg.empty() ? a.svg : a.svg + "/.try"})
    if (!file.empty()) write_file(file, "");
  if (!a.svg.empty()) std::remove((a.svg + "/.try").c_str());
}

std::string file_name(std::string problem) {
  std::replace(problem.begin(), problem.end(), ' ', '_');
  return problem + ".svg";
}

std::string details(const std::string& title, const Table& table) {
  if (table.rows.empty()) return {};
  return "<details><summary>" + html_escape(title) + "</summary>" + table.html() + "</details>\n";
}

class Report {
 public:
  Report(const Arguments& arguments, std::vector<std::string> peers)
      : arguments_(arguments), comparison_(std::move(peers)) {}

  void add(const Case& which, const std::vector<Point>& points) {
    const Table costs = comparison_.add(which.name, points), work = work_at(points, 1e-6);
    const Table ours = standing_of_ours(points);
    Table wrong = unmet(points, "missed");
    for (auto& row : unmet(points, "failed").rows) wrong.rows.push_back(row);
    fmt::print("{}: {}\n{}", which.name, which.text, costs.text());
    if (arguments_.work) fmt::print("\n{}", work.text());
    fmt::print("our runs against 100 tolerances\n{}", ours.text());
    if (!wrong.rows.empty()) fmt::print("{}", wrong.text());
    fmt::print("\n");
    std::fflush(stdout);
    const std::string image = picture(which, points);
    if (!arguments_.svg.empty()) write_file(arguments_.svg + "/" + file_name(which.name), image);
    html_ += fmt::format("<h3>{}</h3>\n<p>{}</p>\n{}\n{}", html_escape(which.name),
                         html_escape(which.text), image, costs.html());
    html_ += details("Work at 1e-6", work) + details("Our runs against 100 tolerances", ours) +
             details("Why ours is beyond 100 tolerances", unmet(points));
    for (const Point& point : points) {
      csv_ += csv_line(point);
      json_.push_back(json_point(point));
    }
  }

  void finish(const Json& versions) {
    std::string matrices;
    fmt::print("CPU at equal error, 1e-3 to 1e-9, all problems\n{}", comparison_.summary().text());
    for (const auto& [pair, standing] : comparison_.standings()) {
      const Table matrix = comparison_.point_by_point(pair);
      fmt::print("\n{}", matrix.text());
      matrices += matrix.html();
    }
    if (!arguments_.csv.empty()) write_file(arguments_.csv, csv_head() + csv_);
    if (!arguments_.html.empty())
      write_file(arguments_.html, "<h2>Error against time</h2>\n" + comparison_.summary().html() +
                                      "<details><summary>Point by point</summary>" + matrices +
                                      "</details>\n" + html_);
    if (!arguments_.json.empty())
      write_json(arguments_.json,
                 Json{{"versions", versions}, {"ratios", comparison_.json()}, {"runs", json_}});
  }

 private:
  const Arguments& arguments_;
  Comparison comparison_;
  std::string html_, csv_;
  Json json_ = Json::array();
};

int run(const Arguments& arguments) {
  const auto [loose, tight] = range(arguments.tolerances);
  if (arguments.list) {
    list(catalogue());
    return 0;
  }
  const std::vector<Case> cases = selected(catalogue(), arguments.problems, arguments.skip);
  const Codes codes = wanted_codes(arguments.peers);
  check_writable(arguments);
  std::vector<std::string> peers;
  Json versions = Json::object();
  for (const auto& code : codes) {
    const std::string base = base_name(code->name());
    if (is_peer(base) && std::find(peers.begin(), peers.end(), base) == peers.end())
      peers.push_back(base);
    versions[code->name()] = code->version();
  }
  Plan plan;
  plan.tolerances = tolerance_ladder(loose, tight, arguments.count);
  plan.repeats = arguments.repeats;
  plan.watch = !arguments.no_watch;
  plan.run_seconds = arguments.seconds;
  plan.reach = !arguments.no_reach;
  Report report(arguments, peers);
  for (const Case& which : cases) report.add(which, measure(which, codes, plan));
  report.finish(versions);
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
