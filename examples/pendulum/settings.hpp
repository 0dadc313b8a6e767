// Tether: command line of the main job. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

namespace pendulum {

struct Settings {
  std::vector<double> tolerances = {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10};
  std::vector<double> long_tolerances = {1e-4, 1e-5, 1e-6, 1e-7, 1e-8};  ///< of the long runs
  bool long_runs = true;                                                 ///< 1000 s as well
  bool quick = false;                       ///< short runs, for a first view
  std::filesystem::path output = "output";  ///< folder of the CSV and SVG files
};

/// Reads the command line. An exit code when the program is to end now: help, or an argument that
/// is wrong (named on stderr).
std::optional<int> parse(int argc, char** argv, Settings& settings);

}  // namespace pendulum
