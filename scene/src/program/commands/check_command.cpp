// Tether: `tether check`: is a scene file right? SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <tether/scene/plan.hpp>

#include "plan/engine_type.hpp"
#include "program/commands.hpp"

namespace tether::scene {

namespace {

struct CheckArguments {
  std::vector<std::string> files;
  bool print = false;
};

int check(const CheckArguments& arguments) {
  int status = kGood;
  for (const std::string& file : arguments.files) {
    try {
      Scene scene = read_scene_argument(file);
      const Plan plan = make_plan(scene);
      if (!arguments.print) print_start(scene);
      make_engine(scene, plan);  // which refuses what a run would
      if (arguments.print) {
        engine_type(plan.engine).spell_out(scene, false);
        fmt::print("{}", write_scene(scene));
        continue;
      }
      fmt::print("{}: right (bodies: {}, effects: {}, expectations: {})\n", on_terminal(file),
                 plan.bodies, plan.effects.size(), scene.expect.size());
    } catch (const SceneError& e) {
      fmt::print(stderr, "{}\n", e.what());
      status = kWrong;
    } catch (const std::exception& e) {
      fmt::print(stderr, "{}: {}\n", on_terminal(file), on_terminal(e.what()));
      status = kWrong;
    }
  }
  return status;
}

}  // namespace

void add_check_command(CLI::App& app, int* status) {
  auto arguments = std::make_shared<CheckArguments>();
  CLI::App* command = app.add_subcommand(
      "check", "Reads scene files and names what is wrong, with line, field and what is allowed");
  command->add_option("scenes", arguments->files, "Scene files (TOML); - is the standard input")
      ->required();
  command->add_flag("--print", arguments->print, "Print the scene with every default spelt out");
  command->footer("Exit code: 0 right, 2 wrong. The format: docs/scene_fields.md.");
  command->callback([arguments, status] { *status = check(*arguments); });
}

}  // namespace tether::scene
