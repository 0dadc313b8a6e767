// Tether: `tether new`: writes a scene to start from. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <memory>

#include "program/commands.hpp"
#include "program/kinds.hpp"
#include "program/new_file.hpp"

namespace tether::scene {

namespace {

struct NewArguments {
  std::string kind, file;
  bool force = false, list = false;
};

/// The first line of a scene's comment says what it is.
std::string summary(std::string_view text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  return std::string(line.substr(std::min<std::size_t>(2, line.size())));
}

int write_new(const NewArguments& arguments) {
  if (arguments.list) {
    for (const Kind& each : kinds()) fmt::print("{:<24} {}\n", each.name, summary(each.text));
    return kGood;
  }
  const auto& all = kinds();
  const auto kind = std::find_if(all.begin(), all.end(),
                                 [&](const Kind& each) { return each.name == arguments.kind; });
  if (kind == all.end()) throw std::invalid_argument("new: name a KIND; --list shows them");
  const std::string file =
      arguments.file.empty() ? std::string(kind->name) + ".toml" : arguments.file;
  write_scene_file(file, std::string(kind->text), arguments.force);
  return kGood;
}

}  // namespace

void add_new_command(CLI::App& app, int* status) {
  auto a = std::make_shared<NewArguments>();
  CLI::App* command =
      app.add_subcommand("new", "Writes a scene to start from, with comments on its fields");
  std::vector<std::string> names;
  for (const Kind& each : kinds()) names.emplace_back(each.name);
  command->add_option("kind", a->kind, "What it is to be")->check(CLI::IsMember(names));
  command->add_option("file", a->file, "Its name [KIND.toml]; - is the standard output");
  command->add_flag("--force", a->force, "Replace a file that is there");
  command->add_flag("--list", a->list, "Name the kinds");
  command->footer("Exit code: 0, 2 no such kind, or the file is there or cannot be written.");
  command->callback([a, status] { *status = write_new(*a); });
}

}  // namespace tether::scene
