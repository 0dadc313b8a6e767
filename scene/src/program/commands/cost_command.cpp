// Tether: `tether cost`: what accuracy costs in time. SPDX-License-Identifier: BSD-3-Clause

#include <progress.hpp>
#include <tether/scene/cost.hpp>

#include "program/commands.hpp"

namespace tether::scene {

namespace {

struct CostArguments {
  std::string file, csv, svg, html;
  std::vector<std::string> tolerances, steps, accuracies;
  std::optional<double> reference, wanted;
  bool force = false;
};

void print_row(const Scene& scene, const CostTable& table, const CostRow& row) {
  if (!row.failure.empty()) {
    fmt::print("  {:<8}  {:>9.3g}  fails: {}\n", name(row.method), row.setting,
               row.failure.substr(0, row.failure.find(". ")));
    return;
  }
  fmt::print("  {:<8}  {:>9.3g}  {:>10.2e}  {:>10.4g}  {:>9}  {:>9.1e}  {:>11.3g}{}\n",
             name(row.method), row.setting, row.error, 1e3 * row.seconds, row.steps,
             table.smooth ? row.drift : row.penetration,
             1e6 * row.seconds / static_cast<double>(std::max(row.steps, 1L)),
             scene.expect.empty() ? "" : fmt::format("  {} of {}", row.met, scene.expect.size()));
}

void print(const Scene& scene, const CostTable& table) {
  fmt::print("{}: errors against {}\n", scene.name.empty() ? on_terminal(scene.file) : scene.name,
             table.reference);
  fmt::print("  (which may be off by {:.1e}; the errors include that)\n", table.reference_error);
  if (!table.no_events.empty()) fmt::print("  events are not compared: {}\n", table.no_events);
  fmt::print("  {:<8}  {:>9}  {:>10}  {:>10}  {:>9}  {:>9}  {:>11}{}\n", "method", "setting",
             "error", "time / ms", "steps", table.smooth ? "drift" : "depth / m", "us per step",
             scene.expect.empty() ? "" : "  expectations met");
  for (const CostRow& row : table.rows) print_row(scene, table, row);
}

std::string table_text(const CostTable& table) {
  std::string out = kCostHead;
  for (const CostRow& row : table.rows)
    out += fmt::format("{},{:g},{:.4e},{:.4e},{},{},{:.3e},{:.3e},{},{}\n", name(row.method),
                       row.setting, row.error, row.seconds, row.steps, row.contact_problems,
                       row.drift, row.penetration, row.met, row.failure.empty() ? "ok" : "failed");
  return out;
}

// Settings of engines that the scene does not have are refused by name.
void check_settings(const Scene& scene, const CostArguments& arguments) {
  const Plan plan = make_plan(scene);
  const bool of_steps = !arguments.steps.empty() || !arguments.accuracies.empty();
  if (plan.engine == EngineKind::smooth && of_steps)
    throw std::invalid_argument("the scene runs on the smooth engine: use --tolerances");
  if (plan.engine == EngineKind::stepping && !arguments.tolerances.empty() &&
      !plan.no_event.empty())
    throw std::invalid_argument("the scene runs on the stepping engine (" + plan.no_event +
                                "): use --time-steps");
}

int run_cost(const CostArguments& arguments) {
  const Scene scene = read_scene(arguments.file);
  check_settings(scene, arguments);
  CostOptions options;
  options.tolerances = read_settings("--tolerances", arguments.tolerances, 10);
  options.steps = read_settings("--time-steps", arguments.steps, 2);
  options.accuracies = read_settings("--accuracies", arguments.accuracies, 10);
  options.reference = arguments.reference;
  options.interrupted = [] { return caught_signal() != 0; };
  catch_signals();
  Output files;
  files["csv"] = arguments.csv;
  files["svg"] = arguments.svg;
  files["html"] = arguments.html;
  check_outputs(files, inputs_of(scene), arguments.force);
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
  if (table.rows.empty()) {
    fmt::print(stderr, "tether: interrupted before the first setting: nothing is written\n");
    return kSignal + caught_signal();
  }
  print(scene, table);
  if (!arguments.csv.empty()) write_whole(arguments.csv, table_text(table));
  if (!arguments.html.empty())
    write_whole(arguments.html, cost_page(scene, table, arguments.wanted));
  if (!arguments.svg.empty())
    write_whole(arguments.svg, cost_picture(scene, table, arguments.wanted));
  if (table.interrupted) {
    fmt::print("interrupted: the other settings are missing\n");
    return kSignal + caught_signal();
  }
  if (!arguments.wanted) return kGood;
  const CostRow* best = table.cheapest(*arguments.wanted);
  if (best == nullptr) {
    fmt::print("no setting reaches an error of {:g}\n", *arguments.wanted);
    return kNotMet;
  }
  fmt::print("cheapest with an error of at most {:g}: {}, {} {:g}, {:.4g} ms\n", *arguments.wanted,
             name(best->method), setting_name(best->method), best->setting, 1e3 * best->seconds);
  return kGood;
}

}  // namespace

void add_cost_command(CLI::App& app, int* status) {
  auto a = std::make_shared<CostArguments>();
  CLI::App* command = app.add_subcommand(
      "cost", "What accuracy costs in time: runs a scene over a range of tolerances or time steps");
  command->add_option("scene", a->file, "Scene file (TOML)")->required();
  command
      ->add_option("--tolerances", a->tolerances,
                   "Tolerances of the smooth or the event engine, each or "
                   "as a range [1e-4:1e-9, or 1e-3:1e-8 with contacts]")
      ->delimiter(',');
  command
      ->add_option("--time-steps", a->steps,
                   "Steps of the stepping engine, s, each or as a range such as 8e-3:1e-3 (halved) "
                   "[8 to 1/4 times that of the scene]")
      ->delimiter(',');
  command
      ->add_option("--accuracies", a->accuracies,
                   "Accuracies of steps, each or as a range [1e-2:1e-5]")
      ->delimiter(',');
  command
      ->add_option("--reference", a->reference,
                   "Tolerance or time step of the reference [1e-12, of events 1e-11 where they "
                   "move the scene, "
                   "else a quarter of the finest step]")
      ->check(positive_number());
  command->add_option("--wanted", a->wanted, "Name the cheapest setting with at most this error")
      ->check(positive_number());
  command->add_option("--csv", a->csv, "Write the table");
  command->add_option("--html", a->html,
                      "Page of error against time, with the command that repeats each setting");
  command->add_option("--svg", a->svg, "Picture of error against time");
  command->add_flag("--force", a->force, "Replace files that Tether did not write");
  command->footer(
      "The error is the largest distance (m) or angle (rad) of a body from the reference at 400 "
      "equal\n"
      "times, and what the reference may be off. Exit code: 0, 1 no setting meets --wanted, 2 the "
      "scene,\na file or an option is wrong, or there is no reference, 130 (143) ended by Ctrl-C "
      "(SIGTERM), with\nthe settings that were done.");
  command->callback([a, status] { *status = run_cost(*a); });
}

}  // namespace tether::scene
