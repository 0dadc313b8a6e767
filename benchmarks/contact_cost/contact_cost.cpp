// Tether: what accuracy costs in contact. SPDX-License-Identifier: BSD-3-Clause
//
//   contact_cost [FOLDER] [--scenes FILE...] [--tolerances 1e-2:1e-10] [--count 9] [--limit s]
//                [--no-siconos] [--csv FILE] [--svg DIR] [--json FILE] [--html FILE]
//
// Residual against CPU of the contact solvers on the problems of FOLDER, and error against CPU of
// the stepping scheme over time steps on scenes. FILE of --csv: solvers; scenes go beside it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fmt/format.h>
#include <sys/stat.h>

#include "accuracy/page.hpp"
#include "contact/siconos.hpp"
#include "projection/curve.hpp"
#include "report.hpp"

using namespace tether::bench;

namespace {

struct Arguments {
  std::string folder, tolerances = "1e-2:1e-10", csv, svg, json, html;
  std::vector<std::string> scenes;
  int count = 9;
  double limit = 1;
  bool no_siconos = false;
};

void read(int argc, char** argv, CLI::App& app, Arguments& a) {
  app.add_option("folder", a.folder, "Folder of contact problems (.dat, .hdf5)")
      ->check(CLI::ExistingDirectory);
  app.add_option("--scenes", a.scenes, "Scene files of the stepping engine")
      ->check(CLI::ExistingFile);
  app.add_option("--tolerances", a.tolerances, "Loosest:tightest");
  app.add_option("--count", a.count, "Number of tolerances")->check(CLI::Range(2, 100));
  app.add_option("--limit", a.limit, "CPU seconds of one solve")->check(CLI::PositiveNumber);
  app.add_flag("--no-siconos", a.no_siconos, "Only our own solvers");
  app.add_option("--csv", a.csv, "One line for each solve; scenes in ..._steps.csv");
  app.add_option("--svg", a.svg, "Folder for pictures, error against time");
  app.add_option("--json", a.json, "All runs");
  app.add_option("--html", a.html, "Tables and pictures as a piece of a page");
  app.parse(argc, argv);
}

std::vector<double> tolerances_of(const Arguments& a) {
  const std::size_t colon = a.tolerances.find(':');
  const double loose = std::atof(a.tolerances.c_str());
  const double tight = colon == std::string::npos ? 0 : std::atof(a.tolerances.c_str() + colon + 1);
  if (!(loose > tight) || !(tight > 0))
    throw CLI::ValidationError("--tolerances",
                               "want loosest:tightest, as in 1e-2:1e-10, not " + a.tolerances);
  return tolerance_ladder(loose, tight, a.count);
}

void write_pictures(const std::string& folder, const Report& report) {
  mkdir(folder.c_str(), 0777);
  for (const auto& [name, image] : report.pictures) {
    std::string file = name;
    std::replace(file.begin(), file.end(), ' ', '_');
    std::replace(file.begin(), file.end(), '/', '_');
    write_file(folder + "/contact_" + file + ".svg", image);
  }
}

std::string page(const std::string& title, const Report& report) {
  std::string out = "<h3>" + title + "</h3>\n" + report.html;
  if (!report.pictures.empty()) out += "<details><summary>Pictures</summary>\n";
  for (const auto& each : report.pictures) out += each.second;
  return out + (report.pictures.empty() ? "" : "</details>\n");
}

int run(const Arguments& a) {
  Report solvers, steps;
  if (a.folder.empty()) {
    solvers.text = "contact solvers left out: no folder of problems\n";
  } else {
    SolverPlan plan;
    plan.folder = a.folder;
    plan.tolerances = tolerances_of(a);
    plan.limit = a.limit;
    plan.siconos = !a.no_siconos;
    solvers = solver_cost(plan);
  }
  fmt::print("{}", solvers.text);
  std::fflush(stdout);
  steps = step_cost(a.scenes);
  fmt::print("{}", steps.text);
  if (!a.csv.empty()) {
    const std::size_t dot = a.csv.rfind(".csv");
    write_file(a.csv, solvers.csv);
    write_file(a.csv.substr(0, dot) + "_steps.csv", steps.csv);
  }
  if (!a.svg.empty()) {
    write_pictures(a.svg, solvers);
    write_pictures(a.svg, steps);
  }
  if (!a.json.empty()) write_json(a.json, Json{{"solvers", solvers.json}, {"steps", steps.json}});
  if (!a.html.empty())
    write_file(a.html, page("Contact solvers: residual against time", solvers) +
                           page("Stepping scheme: error against time", steps));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  tether::contact::use_one_thread(argv);
  CLI::App app("Error against time of contact solvers and of the stepping scheme");
  Arguments arguments;
  try {
    read(argc, argv, app, arguments);
    return run(arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    fmt::print(stderr, "contact_cost: {}\n", error.what());
    return 1;
  }
}
