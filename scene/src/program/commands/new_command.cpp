// Tether: `tether new`: writes a scene to start from. SPDX-License-Identifier: BSD-3-Clause
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "program/commands.hpp"

namespace tether::scene {

namespace {

/// Writes a file that is not there, whole or not at all.
void make_new(const std::string& file, std::string_view content) {
  namespace fs = std::filesystem;
  const std::invalid_argument there(file + " is there already; --force replaces it");
  std::error_code error;
  if (fs::exists(fs::symlink_status(file, error))) throw there;
  make_folder_of(file);
  const std::string fresh = file + ".new";
  write_new(fresh, content);
  // The whole file gets its name only where nobody else took it in between.
  const int linked = link(fresh.c_str(), file.c_str());
  const int reason = errno;
  if (linked != 0 && reason != EEXIST)  // some file systems have no second names
    return fs::rename(fresh, file);
  fs::remove(fresh, error);
  if (linked != 0) throw there;
}

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

void write_scene_file(const std::string& file, const std::string& text, bool force) {
  if (file == "-") return StandardOutput(file).write(text);
  catch_signals();  // the file is whole before they count
  if (force)
    write_whole(file, text);
  else
    make_new(file, text);
  fmt::print("written: {0}\nnext: tether run {0}\n", on_terminal(file));
}

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
