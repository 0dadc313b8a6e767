// Tether: files that are not there yet. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace tether::scene {

/// Writes a file that is not there, whole or not at all. std::invalid_argument where it is there
/// already, std::runtime_error where it cannot be written.
void make_new(const std::string& file, std::string_view content);

}  // namespace tether::scene
