// Tether: files of the main job. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "measure.hpp"

namespace pendulum {

using Files = std::vector<std::filesystem::path>;

/// pendulum.csv, one line for each run, and pendulum_drift.csv, drift over time.
Files write_csv(const std::filesystem::path& folder, const std::vector<Results>& all);

void print_names(const Files& files);

}  // namespace pendulum
