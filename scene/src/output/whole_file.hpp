// Tether: files that are whole or absent. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace tether::scene {

/// Makes the folder of a file. Throws std::runtime_error.
void make_folder_of(const std::string& file);

/// Replaces the file in one go: who reads it finds the old content or all of the new one, after a
/// loss of power, too. What is there and no regular file (/dev/stdout) is written to. Throws
/// std::runtime_error.
void write_whole(const std::string& file, std::string_view content);

/// The same for what must be a regular file, if it is there.
void write_whole_regular(const std::string& file, std::string_view content);

}  // namespace tether::scene
