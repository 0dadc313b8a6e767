// Tether: files that are not there yet. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace tether::scene {

/// Writes a scene, whole or not at all, and says so; "-" is the standard output. Without `force`
/// std::invalid_argument where the file is there already, std::runtime_error where it cannot be
/// written.
void write_scene_file(const std::string& file, const std::string& text, bool force);

}  // namespace tether::scene
