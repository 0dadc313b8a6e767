// Tether: the DAE problems of SciMLBenchmarks, by every code. SPDX-License-Identifier: BSD-3-Clause
//
//   dae_set [--problem P] [--tolerances 1e-4,1e-6] [--seconds S] [--repeats N] [--svg DIR]
//
// Prints Markdown: what projection gains over IDA alone, then each run's digits and work.
#include <fmt/core.h>
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>

#include "report.hpp"

using namespace tether::bench;

namespace {

const std::vector<std::string> kColumns = {"IDA",   "IDA suppressed",   "Tether",    "RADAU5",
                                           "DASPK", "DASPK suppressed", "CVODE+proj"};

struct Cell {
  bool ran = false;   // the code takes this form
  bool late = false;  // it, or a run at a looser tolerance, took too long
  Run run;
  double digits = std::nan("");
  bool good() const { return ran && !run.failed && std::isfinite(digits); }
  /// It has the digits that the tolerance asks for, less one.
  bool exact(double tolerance) const { return good() && digits >= -std::log10(tolerance) - 1.0; }
};

// By code, then by tolerance.
using Runs = std::map<std::string, std::vector<Cell>>;

std::string text(const Cell& cell) {
  if (!cell.ran) return "";
  if (cell.late) return "limit";
  if (!cell.good()) return "fails";
  return fmt::format("{:.1f}, {}, {}, {:.3g}", cell.digits, cell.run.steps, cell.run.residuals,
                     cell.run.cpu_ms);
}

std::string line(const std::vector<std::string>& cells) {
  std::string out = "|";
  for (const std::string& cell : cells) out += " " + cell + " |";
  return out + "\n";
}

std::string head(const std::vector<std::string>& cells) {
  std::string out = line(cells) + "|";
  for (std::size_t k = 0; k < cells.size(); ++k) out += "---|";
  return out + "\n";
}

// A code that took too long is not tried at tighter tolerances.
Runs run_all(const tether::problems::Problem& problem, const Codes& codes,
             const std::vector<double>& tolerances, const Limits& limits, int repeats) {
  Runs runs;
  for (const auto& code : codes) {
    std::vector<Cell>& cells = runs[code->name()];
    cells.resize(tolerances.size());
    if (!code->missing().empty() || !code->refuses(problem).empty()) continue;
    bool late = false;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      Cell& cell = cells[k];
      cell.ran = true;
      cell.run.failed = true;
      std::vector<double> cpu;
      for (int repeat = 0; repeat < repeats && !late; ++repeat) {
        cell.run = code->run(problem, tolerances[k], limits, {});
        cpu.push_back(cell.run.cpu_ms);
        late = cell.run.failed && cell.run.cpu_ms > 999.0 * limits.cpu_seconds;
        if (cell.run.failed || cell.run.cpu_ms > 100.0) break;
      }
      cell.late = late;
      if (cell.run.failed) continue;
      cell.run.cpu_ms = median(cpu);
      cell.digits = significant_digits(problem, cell.run.y);
    }
  }
  return runs;
}

// Tolerances at which it ends, and of these with the digits asked less one.
std::string solved(const std::vector<Cell>& cells, const std::vector<double>& tolerances) {
  if (cells.empty() || !cells.front().ran) return "-";
  int ends = 0, exact = 0;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    ends += cells[k].good();
    exact += cells[k].exact(tolerances[k]);
  }
  return fmt::format("{} ({})", ends, exact);
}

// Digits are relative: an absolute tolerance is in the unit of its component of the reference, at
// most in that of the problem and at least in a ten-thousandth of it.
void set_units(tether::problems::Problem& problem) {
  const double smallest = 1e-4;
  problem.atol_scale.resize(static_cast<std::size_t>(problem.size), 1.0);
  for (std::size_t k = 0; k < static_cast<std::size_t>(problem.error_components); ++k)
    if (double& unit = problem.atol_scale[k]; std::abs(problem.reference[k]) > 0)
      unit *= std::clamp(std::abs(problem.reference[k]) / unit, smallest, 1.0);
}

// Digits, F and time of ours beside the variant of IDA with more digits, where both run.
std::vector<std::string> summary(const Runs& runs, const std::vector<double>& tolerances) {
  const auto &ours = runs.at("Tether"), &one = runs.at("IDA"), &other = runs.at("IDA suppressed");
  double digits = 0.0;
  GeometricMean evaluations, time;
  bool only_ours = false, only_theirs = false;
  for (std::size_t k = 0; k < ours.size(); ++k) {
    const Cell& ida =
        !other[k].good() || (one[k].good() && one[k].digits > other[k].digits) ? one[k] : other[k];
    only_ours = only_ours || (ours[k].good() && !ida.good() && !one[k].late && !other[k].late);
    only_theirs = only_theirs || (ours[k].ran && !ours[k].good() && !ours[k].late && ida.good());
    if (!ours[k].good() || !ida.good()) continue;
    digits += ours[k].digits - ida.digits;
    evaluations.add(static_cast<double>(ours[k].run.residuals) /
                    static_cast<double>(ida.run.residuals));
    time.add(ours[k].run.cpu_ms / ida.run.cpu_ms);
  }
  const int both = evaluations.count();
  digits /= std::max(1, both);
  const double worth = 0.3;  // digits, half of an error
  const std::string verdict = !one.front().ran     ? "IDA and Tether refuse index 3"
                              : !ours.front().ran  ? "nothing to project"
                              : only_theirs        ? "fails where IDA runs"
                              : only_ours          ? "runs where IDA fails"
                              : both == 0          ? "neither runs"
                              : digits > worth     ? "more digits"
                              : digits < -worth    ? "fewer digits"
                              : time.value() < 0.9 ? "faster"
                                                   : "nothing gained";
  const auto ratio = [&](const GeometricMean& of) {
    return both > 0 ? fmt::format("{:.2f}", of.value()) : std::string("-");
  };
  return {solved(one, tolerances),
          solved(other, tolerances),
          solved(ours, tolerances),
          solved(runs.at("RADAU5"), tolerances),
          both > 0 ? fmt::format("{:+.1f}", digits) : "-",
          ratio(evaluations),
          ratio(time),
          verdict};
}

// Which runs have the digits asked less one. Of a problem and tolerance a code's best form counts.
class Misses {
 public:
  void add(const std::string& problem, const std::map<std::string, Runs>& forms,
           const std::vector<double>& tolerances) {
    for (std::size_t k = 0; k < tolerances.size(); ++k) {
      std::string reached;
      std::vector<std::string> best;
      for (Count& each : counts_) {
        const Cell cell = best_of(forms, each.variants, k);
        const bool exact = cell.exact(tolerances[k]);
        best.push_back(shown(cell));
        each.runs += cell.ran, each.misses += cell.ran && !exact;
        if (exact && each.code != "Tether") reached += (reached.empty() ? "" : ", ") + each.code;
      }
      if (reached.empty()) reached = "none";
      for (const auto& [form, runs] : forms) {
        const Cell& ours = runs.at("Tether")[k];
        if (!ours.ran || ours.exact(tolerances[k])) continue;
        ++misses_, alone_ += reached != "none";
        std::vector<std::string> cells = {problem, form, fmt::format("{:.0e}", tolerances[k]),
                                          shown(ours)};
        cells.insert(cells.end(), best.begin(), best.end());
        cells.push_back(reached);
        rows_ += line(cells);
      }
    }
  }

  std::string markdown() const {
    std::string out =
        "\n## Digits asked less one\n\nProblems and tolerances at which they are missed";
    std::vector<std::string> columns = {"problem", "form", "tolerance", "Tether in it"};
    for (const Count& each : counts_) {
      out += fmt::format(", {} {} of {}", each.code, each.misses, each.runs);
      columns.push_back(each.code);
    }
    columns.emplace_back("others who have them");
    out += fmt::format(
        ", each code in its best form. All runs of Tether that miss them, in any form, follow; at "
        "{} "
        "of these {} another code has them, at the others none: they belong to the problem at that "
        "tolerance.\n\n",
        alone_, misses_);
    return out + head(columns) + rows_;
  }

 private:
  struct Count {
    std::string code;
    std::vector<std::string> variants;
    int runs = 0, misses = 0;
  };
  static Cell best_of(const std::map<std::string, Runs>& forms,
                      const std::vector<std::string>& variants, std::size_t k) {
    Cell best;
    for (const auto& [form, runs] : forms)
      for (const std::string& name : variants) {
        const Cell& cell = runs.at(name)[k];
        if (!best.good() ? cell.ran : cell.good() && cell.digits > best.digits) best = cell;
      }
    return best;
  }
  static std::string shown(const Cell& cell) {
    return cell.good() ? fmt::format("{:.1f}", cell.digits) : text(cell);
  }

  std::vector<Count> counts_ = {{"Tether", {"Tether"}},
                                {"IDA", {"IDA", "IDA suppressed"}},
                                {"RADAU5", {"RADAU5"}},
                                {"DASPK", {"DASPK", "DASPK suppressed"}}};
  int misses_ = 0, alone_ = 0;
  std::string rows_;
};

void add_points(const std::string& form, const std::vector<double>& tolerances, const Runs& runs,
                std::vector<Point>& points) {
  for (const auto& [code, cells] : runs) {
    for (std::size_t k = 0; k < cells.size(); ++k) {
      if (!cells[k].good()) continue;
      Point point;
      point.form = form;
      point.code = code;
      point.tolerance = tolerances[k];
      point.run = cells[k].run;
      point.run.error = std::pow(10.0, -cells[k].digits);
      points.push_back(std::move(point));
    }
  }
}

Codes wanted_codes() {
  Codes wanted, all = all_codes();
  for (auto& code : all)
    if (std::find(kColumns.begin(), kColumns.end(), code->name()) != kColumns.end())
      wanted.push_back(std::move(code));
  return wanted;
}

int run(const std::vector<Case>& cases, const std::vector<double>& tolerances, double seconds,
        int repeats, const std::string& pictures) {
  if (!pictures.empty()) mkdir(pictures.c_str(), 0777);

  const Limits limits{300000, seconds};
  const Codes codes = wanted_codes();
  std::string table = head({"problem", "form", "IDA", "IDA suppressed", "Tether", "RADAU5",
                            "digits", "F", "time", "Tether beside IDA"});
  std::string details;
  Misses misses;
  for (const Case& which : cases) {
    fmt::print(stderr, "{}\n", which.name);
    details += fmt::format("\n## {}: {}\n\n", which.name, which.text);
    std::vector<std::string> columns = {"form", "tolerance"};
    columns.insert(columns.end(), kColumns.begin(), kColumns.end());
    std::string rows;
    std::vector<Point> points;
    std::map<std::string, Runs> forms;
    for (tether::problems::Problem problem : which.forms) {
      set_units(problem);
      Runs runs = run_all(problem, codes, tolerances, limits, repeats);
      for (const std::string& column : kColumns) runs[column].resize(tolerances.size());
      std::vector<std::string> cells = {which.name, problem.form};
      for (std::string& cell : summary(runs, tolerances)) cells.push_back(std::move(cell));
      table += line(cells);
      for (std::size_t k = 0; k < tolerances.size(); ++k) {
        cells = {problem.form, fmt::format("{:.0e}", tolerances[k])};
        for (const std::string& column : kColumns) cells.push_back(text(runs[column][k]));
        rows += line(cells);
      }
      add_points(problem.form, tolerances, runs, points);
      forms[problem.form] = std::move(runs);
    }
    misses.add(which.name, forms, tolerances);
    if (!pictures.empty()) {
      std::string file = which.name + ".svg";
      std::replace(file.begin(), file.end(), ' ', '_');
      write_file(pictures + "/" + file,
                 picture(which, points, "relative error of the worst component"));
      details += fmt::format("![error against time]({}/{})\n\n",
                             pictures.substr(pictures.rfind('/') + 1), file);
    }
    details += head(columns) + rows;
  }
  fmt::print("{}{}{}", table, misses.markdown(), details);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The DAE problems of SciMLBenchmarks, by every code");
  std::vector<std::string> problems;
  std::vector<double> tolerances = {1e-4, 1e-6, 1e-8, 1e-10};
  double seconds = 10.0;
  int repeats = 3;
  std::string pictures;
  app.add_option("--problem", problems, "Only problems whose name contains one of these")
      ->delimiter(',');
  app.add_option("--tolerances", tolerances, "From loose to tight")->delimiter(',');
  app.add_option("--seconds", seconds, "CPU limit of one run")->check(CLI::PositiveNumber);
  app.add_option("--repeats", repeats, "Runs of which the median time counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--svg", pictures, "Folder for pictures, error against time");
  try {
    app.parse(argc, argv);
    for (const double tolerance : tolerances)
      if (!(tolerance > 0.0 && tolerance < 1.0))
        throw std::invalid_argument(
            fmt::format("--tolerances: {:g}: must be > 0 and < 1", tolerance));
    return run(selected(dae_set(), problems), tolerances, seconds, repeats, pictures);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    fmt::print(stderr, "dae_set: {}\n", error.what());
    return 1;
  }
}
