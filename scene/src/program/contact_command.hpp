// Tether: `tether contact`. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>

namespace tether::scene {

/// Adds the subcommand; after parsing, *status is what main returns.
void add_contact_command(CLI::App& app, int* status);

}  // namespace tether::scene
