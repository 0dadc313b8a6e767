// Tether: files that are whole or absent. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace tether::scene {

/// Somebody does not want to wait for the other end of a pipe.
struct Interrupted : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// open(2) with O_WRONLY and these flags. A pipe without a reader is waited for until a signal
/// comes that somebody handles: Interrupted.
int open_to_write(const std::string& file, int flags);

/// Makes the folder of a file. Throws std::runtime_error.
void make_folder_of(const std::string& file);

/// Replaces the file atomically: a reader finds the old content or all of the new one, also after a
/// loss of power. A target that is not a regular file (/dev/stdout) is written to. Throws
/// std::runtime_error.
void write_whole(const std::string& file, std::string_view content);

/// The same, but an existing target must be a regular file.
void write_whole_regular(const std::string& file, std::string_view content);

/// A file that nobody reads before the run has named it elsewhere: gone again where it could not be
/// written. What had its name is removed first. Throws std::runtime_error.
void write_fresh(const std::string& file, std::string_view content);

/// The same where nothing has the name; what has it stays, and std::runtime_error says so.
void write_new(const std::string& file, std::string_view content);

/// The error of `write_whole` before the work is done; makes the folder.
void check_writable(const std::string& file);

}  // namespace tether::scene
