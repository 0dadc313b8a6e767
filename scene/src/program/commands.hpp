// Tether: the subcommands of the program. SPDX-License-Identifier:
// BSD-3-Clause
//
// Each sets *status to the exit code of the program.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "process/standard_streams.hpp"

namespace tether::scene {

void add_check_command(CLI::App& app, int* status);
void add_contact_command(CLI::App& app, int* status);
void add_cost_command(CLI::App& app, int* status);
void add_import_command(CLI::App& app, int* status);
void add_new_command(CLI::App& app, int* status);
void add_plan_command(CLI::App& app, int* status);
void add_run_command(CLI::App& app, int* status);
void add_sweep_command(CLI::App& app, int* status);

struct Kind {
  std::string_view name, text;
};

/// Made at configuration from the files in `kinds`.
const std::vector<Kind>& kinds();

/// Writes a scene, whole or not at all, and says so; "-" is the standard output. Without `force`
/// std::invalid_argument where the file is there already, std::runtime_error where it cannot be
/// written.
void write_scene_file(const std::string& file, const std::string& text, bool force);

}  // namespace tether::scene
