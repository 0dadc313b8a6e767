// Tether: `tether plan`: what a scene asks for. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <iostream>
#include <tether/scene/plan.hpp>

#include "program/commands.hpp"
#include "program/process.hpp"

namespace tether::scene {

namespace {

struct PlanArguments {
  std::string file;
  bool run = false;
};

// Who begins inside whom is found by a step, which takes some 2 kB a body.
constexpr int kMostChecked = 10000;  // bodies

int plan(const PlanArguments& arguments) {
  const Scene scene = read_scene_argument(arguments.file);
  const Plan plan = make_plan(scene);
  std::cout << plan << std::flush;
  if (plan.bodies <= kMostChecked)
    print_start(scene);
  else
    fmt::print("note      tether check tells which of so many bodies begin inside each other\n");
  if (!arguments.run) return kGood;
  Scene silent = scene;
  silent.output = Output{};
  catch_signals();
  RunOptions options;
  options.interrupted = [] { return caught_signal() != 0; };
  const RunResult result = run(silent, options);
  print_costs(result);
  if (result.interrupted) {
    fmt::print("interrupted at {:.9g} s of {:g} s\n", result.time, scene.end);
    return kSignal + caught_signal();
  }
  if (!result.failure.empty()) fmt::print("stopped at {:g} s: {}\n", result.time, result.failure);
  return result.failure.empty() ? kGood : kFailed;
}

}  // namespace

void add_plan_command(CLI::App& app, int* status) {
  auto arguments = std::make_shared<PlanArguments>();
  CLI::App* command = app.add_subcommand(
      "plan", "Tells which effects a scene asks for, which engine moves it, and how large it is");
  command->add_option("scene", arguments->file, "Scene file (TOML); - is the standard input")
      ->required();
  command->add_flag("--run", arguments->run, "Run it, and tell what each effect cost");
  command->footer(
      "Exit code: 0, 2 the scene is wrong or no engine has it, 3 --run could not go on, 130 (143) "
      "--run\nended by Ctrl-C (SIGTERM).");
  command->callback([arguments, status] { *status = plan(*arguments); });
}

}  // namespace tether::scene
