// Tether: `tether cost`: what accuracy costs in time. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/os.h>

#include <memory>
#include <optional>
#include <progress.hpp>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "commands.hpp"
#include "record/gnuplot.hpp"
#include "settings.hpp"

namespace tether::scene {

namespace {

struct Arguments {
  std::string file, csv, svg;
  std::vector<std::string> tolerances, steps;
  std::optional<double> reference, wanted;
};

const char* setting_name(const CostTable& table) { return table.smooth ? "tolerance" : "step / s"; }

void print(const Scene& scene, const CostTable& table) {
  fmt::print("{}: errors against {}\n", scene.name.empty() ? scene.file : scene.name,
             table.reference);
  fmt::print("  (which may be off by {:.1e}; the errors include that)\n", table.reference_error);
  fmt::print("  {:>9}  {:>10}  {:>10}  {:>9}  {:>9}  {:>11}{}\n", setting_name(table), "error",
             "time / ms", "steps", table.smooth ? "drift" : "depth / m", "us per step",
             scene.expect.empty() ? "" : "  expectations met");
  for (const CostRow& row : table.rows) {
    if (!row.failure.empty()) {
      fmt::print("  {:>9.3g}  fails: {}\n", row.setting,
                 row.failure.substr(0, row.failure.find(". ")));
      continue;
    }
    fmt::print("  {:>9.3g}  {:>10.2e}  {:>10.4g}  {:>9}  {:>9.1e}  {:>11.3g}{}\n", row.setting,
               row.error, 1e3 * row.seconds, row.steps, table.smooth ? row.drift : row.penetration,
               1e6 * row.seconds / static_cast<double>(std::max(row.steps, 1L)),
               scene.expect.empty() ? "" : fmt::format("  {} of {}", row.met, scene.expect.size()));
  }
}

void write_csv(const std::string& file, const CostTable& table) {
  fmt::ostream out = fmt::output_file(file);
  out.print("{},error,seconds,steps,drift,penetration_m,expectations_met,status\n",
            table.smooth ? "tolerance" : "step_s");
  for (const CostRow& row : table.rows)
    out.print("{:g},{:.4e},{:.4e},{},{:.3e},{:.3e},{},{}\n", row.setting, row.error, row.seconds,
              row.steps, row.drift, row.penetration, row.met,
              row.failure.empty() ? "ok" : "failed");
}

/// Error against time, each point with its setting.
std::string draw(const std::string& file, const Scene& scene, const CostTable& table) {
  std::string script = picture_head(560, 400) + "$runs << EOD\n";
  for (const CostRow& row : table.rows)
    if (row.failure.empty())
      script += fmt::format("{:.4e} {:.4e} {:g}\n", 1e3 * row.seconds, std::max(row.error, 1e-17),
                            row.setting);
  script += "EOD\n";
  std::string title;
  for (const char c : scene.name) title += c == '\'' ? ' ' : c;
  script += fmt::format(
      "set logscale xy\nset format xy '10^{{%T}}'\nset xlabel 'processor time / ms'\nset ylabel "
      "'largest error / m, rad'\nset title '{}: what accuracy costs' noenhanced\nset offsets graph "
      "0.1, graph 0.2, graph 0.1, graph 0.05\n"
      "plot $runs using 1:2 with linespoints lc rgb '#0072b2' lw 1.5 pt 7 ps 0.6 title '{}', $runs "
      "using 1:2:3 with labels offset 3.2,0.6 font ',11' tc rgb '#404040' notitle",
      title, setting_name(table));
  if (table.reference_error > 1e-16)
    script +=
        fmt::format(", {:.3e} with lines lc rgb '#999999' dt 2 title 'trust in the reference'",
                    table.reference_error);
  return gnuplot(script + "\n", file);
}

int run_cost(const Arguments& arguments) {
  const Scene scene = read_scene(arguments.file);
  const bool smooth = !arguments.tolerances.empty(), stepping = !arguments.steps.empty();
  const bool has_tolerance = make_plan(scene).engine != EngineKind::stepping;
  if (has_tolerance ? stepping : smooth)
    throw std::invalid_argument(has_tolerance
                                    ? "the scene runs on the smooth engine: use --tolerances"
                                    : "the scene runs on the stepping engine: use --time-steps");
  CostOptions options;
  options.settings = has_tolerance ? read_settings("--tolerances", arguments.tolerances, 10)
                                   : read_settings("--time-steps", arguments.steps, 2);
  options.reference = arguments.reference;
  std::optional<tether::Progress> bar;
  options.progress = [&](const std::string& what, int done, int all) {
    if (done == 0)
      bar.emplace(all);
    else
      bar->finish();
    bar->start(what, 1, 1);
  };
  const CostTable table = cost(scene, options);
  bar.reset();
  print(scene, table);
  if (!arguments.csv.empty()) write_csv(arguments.csv, table);
  if (!arguments.svg.empty()) {
    const std::string why = draw(arguments.svg, scene, table);
    if (!why.empty()) fmt::print(stderr, "no picture: {}\n", why);
  }
  if (!arguments.wanted) return kGood;
  const CostRow* best = table.cheapest(*arguments.wanted);
  if (best == nullptr) {
    fmt::print("no setting reaches an error of {:g}\n", *arguments.wanted);
    return kNotMet;
  }
  fmt::print("cheapest with an error of at most {:g}: {} {:g}, {:.4g} ms\n", *arguments.wanted,
             table.smooth ? "tolerance" : "step", best->setting, 1e3 * best->seconds);
  return kGood;
}

}  // namespace

void add_cost_command(CLI::App& app, int* status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "cost", "What accuracy costs in time: runs a scene over a range of tolerances or time steps");
  command->add_option("scene", a->file, "Scene file (TOML)")->required();
  CLI::Option* tolerances = command
                                ->add_option("--tolerances", a->tolerances,
                                             "Tolerances of the smooth engine, each or as a range "
                                             "[1e-4:1e-9]")
                                ->delimiter(',');
  command
      ->add_option("--time-steps", a->steps,
                   "Steps of the stepping engine, s, each or as a range such as 8e-3:1e-3 (halved) "
                   "[8 to 1/4 times that of the scene]")
      ->delimiter(',')
      ->excludes(tolerances);
  command
      ->add_option("--reference", a->reference,
                   "Tolerance or time step of the reference [1e-12, or a quarter of the finest]")
      ->check(positive_number());
  command->add_option("--wanted", a->wanted, "Name the cheapest setting with at most this error")
      ->check(positive_number());
  command->add_option("--csv", a->csv, "Write the table");
  command->add_option("--svg", a->svg, "Draw error against time (needs gnuplot)");
  command->footer(
      "The error is the largest distance (m) or angle (rad) of a body from the reference at 100 "
      "equal\n"
      "times, and what the reference may be off. Exit code: 0, 1 no setting meets --wanted, 2 the "
      "scene or an option is wrong, or "
      "there\n"
      "is no reference.");
  command->callback([a, status] { *status = run_cost(*a); });
}

}  // namespace tether::scene
