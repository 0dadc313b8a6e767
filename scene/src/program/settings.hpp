// Tether: numbers of the command line. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tether::scene {

/// A finite number; nothing else has a value.
std::optional<double> finite_number(const std::string& text);
/// Refuses all but finite numbers > 0.
CLI::Validator positive_number();

/// Each item is a number > 0 or a range "1e-3:1e-9", which gives both ends and what lies between
/// them by factors of `ratio`. std::invalid_argument naming `option` and the item otherwise.
std::vector<double> read_settings(const std::string& option, const std::vector<std::string>& items,
                                  double ratio);

}  // namespace tether::scene
