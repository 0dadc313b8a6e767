// Tether: runs gnuplot. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace tether::scene {

/// Runs a script and writes its picture to `file`; empty on success, else why there is no picture
/// (the script is left beside it then, ending .gp). Throws std::runtime_error where nothing can be
/// written.
std::string gnuplot(const std::string& script, const std::string& file);

/// Settings common to all pictures: terminal, axes, colours.
std::string picture_head(int width, int height);

}  // namespace tether::scene
