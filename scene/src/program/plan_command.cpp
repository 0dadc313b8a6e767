// Tether: `tether plan`: what a scene asks for. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <iostream>
#include <memory>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "commands.hpp"

namespace tether::scene {

namespace {

struct Arguments {
  std::string file;
};

int plan(const Arguments& arguments) {
  const Scene scene = read_scene(arguments.file);
  std::cout << make_plan(scene);
  return kGood;
}

}  // namespace

void add_plan_command(CLI::App& app, int* status) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "plan", "Tells which effects a scene asks for, which engine moves it, and how large it is");
  command->add_option("scene", arguments->file, "Scene file (TOML)")->required();
  command->callback([arguments, status] { *status = plan(*arguments); });
}

}  // namespace tether::scene
