// Tether: what a run writes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene {

/// The path in one spelling; links are followed as far as they exist.
std::string one_name(const std::string& file);
/// Whether a path ends in a name.
bool names_file(const std::string& path);
/// The same for all spellings of a path, and for second names of a file.
std::string identity(const std::string& file);
/// Something there that is neither a file nor a folder.
bool is_device(const std::string& file);

/// The scene and what was read with it.
std::vector<std::string> inputs_of(const Scene& scene);

/// Throws std::invalid_argument if a page is to be written over one of the others, which may be
/// empty.
void check_page_name(const std::string& html, const std::vector<std::string>& others);

}  // namespace tether::scene
