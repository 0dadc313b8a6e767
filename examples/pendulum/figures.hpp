// Tether: pictures of the main job, by gnuplot over its CSV files.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "csv.hpp"

namespace pendulum {

/// Error against CPU time, and drift over time, as SVG beside the CSV files; adds their names to
/// `files`. Without gnuplot: a message on stderr, nothing else.
void draw(const std::filesystem::path& folder, const std::vector<Results>& all, Files& files);

}  // namespace pendulum
