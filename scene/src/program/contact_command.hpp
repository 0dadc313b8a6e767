// Tether: `tether contact`. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>

namespace tether::scene {

/// Adds the subcommand; after parsing, *status is the exit code.
void add_contact_command(CLI::App& app, int* status);

}  // namespace tether::scene
