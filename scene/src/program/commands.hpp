// Tether: the subcommands of the program. SPDX-License-Identifier:
// BSD-3-Clause
//
// Each sets *status to the exit code of the program.
#pragma once

#include <CLI/CLI.hpp>

namespace tether::scene {

/// Exit codes of `tether`.
enum ExitCode : int {
  kGood = 0,
  kNotMet = 1,   ///< an [[expect]] does not hold, a contact problem is not solved
  kWrong = 2,    ///< a file, a scene or an option is wrong; nothing was run
  kFailed = 3,   ///< the run could not go on
  kSignal = 128  ///< and the number of the signal that ended it, as shells have it
};

void add_check_command(CLI::App& app, int* status);
void add_contact_command(CLI::App& app, int* status);
void add_cost_command(CLI::App& app, int* status);
void add_import_command(CLI::App& app, int* status);
void add_new_command(CLI::App& app, int* status);
void add_plan_command(CLI::App& app, int* status);
void add_run_command(CLI::App& app, int* status);
void add_sweep_command(CLI::App& app, int* status);

}  // namespace tether::scene
