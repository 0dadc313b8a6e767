// Tether: the subcommands of the program. SPDX-License-Identifier:
// BSD-3-Clause
//
// Each sets *status to the exit code of the program.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <string>
#include <string_view>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>
#include <tether/scene/vary.hpp>
#include <vector>

#include "output/files.hpp"
#include "program/process.hpp"
#include "record/formats.hpp"

namespace tether::scene {

// Names of files are those of whoever made the folder: *.toml may hold what a terminal obeys.

/// Lines without what a terminal obeys (files::printable).
std::string on_terminal(std::string_view text);

/// A field of CSV: quoted where it has to be; control characters become blanks.
std::string table_field(std::string_view text);

/// Energies, errors, work, times, each [[expect]] with the value found, and files. `shared`: a line
/// behind the summary, or nothing; `wall`: seconds of the whole program, reading and output
/// included.
void report(const Scene& scene, const RunResult& result, const std::string& shared, double wall);
/// Time spent on each effect.
void print_costs(const RunResult& result);
/// kGood, kNotMet or kFailed.
int exit_code(const RunResult& result);

/// Files that would be lost, or cannot be written, are told before the work.
void check_outputs(const Output& files, const std::vector<std::string>& inputs, bool force);

/// A finite number; nothing else has a value.
std::optional<double> finite_number(const std::string& text);
/// Refuses all but finite numbers > 0.
CLI::Validator positive_number();

/// Each item is a number > 0 or a range "1e-3:1e-9", which gives both ends and what lies between
/// them by factors of `ratio`. std::invalid_argument naming `option` and the item otherwise.
std::vector<double> read_settings(const std::string& option, const std::vector<std::string>& items,
                                  double ratio);

struct SceneText {
  std::string text, name;
};

/// The text of any file of at most 256 MiB; "-" is the standard input. std::invalid_argument where
/// it cannot be read.
SceneText read_text(const std::string& file);

/// "-" is the standard input. Throws SceneError where there is nothing to read.
SceneText read_scene_text(const std::string& file);

/// The scene of a file or, of "-", of the standard input.
Scene read_scene_argument(const std::string& file);

void add_check_command(CLI::App& app, int* status);
void add_contact_command(CLI::App& app, int* status);
void add_cost_command(CLI::App& app, int* status);
void add_import_command(CLI::App& app, int* status);
void add_new_command(CLI::App& app, int* status);
void add_plan_command(CLI::App& app, int* status);
void add_run_command(CLI::App& app, int* status);
void add_sweep_command(CLI::App& app, int* status);
void add_verify_command(CLI::App& app, int* status);

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
