// Tether: files that are not there yet. SPDX-License-Identifier: BSD-3-Clause
#include "new_file.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "output/whole_file.hpp"
#include "program/process/signals.hpp"
#include "program/process/standard_streams.hpp"
#include "program/terminal_text.hpp"

namespace tether::scene {

namespace {

/// Writes a file that is not there, whole or not at all.
void make_new(const std::string& file, std::string_view content) {
  namespace fs = std::filesystem;
  const std::invalid_argument there(file + " is there already; --force replaces it");
  std::error_code error;
  if (fs::exists(fs::symlink_status(file, error))) throw there;
  make_folder_of(file);
  const std::string fresh = file + ".new";
  write_new(fresh, content);
  // The whole file gets its name only where nobody else took it in between.
  const int linked = link(fresh.c_str(), file.c_str());
  const int reason = errno;
  if (linked != 0 && reason != EEXIST)  // some file systems have no second names
    return fs::rename(fresh, file);
  fs::remove(fresh, error);
  if (linked != 0) throw there;
}

}  // namespace

void write_scene_file(const std::string& file, const std::string& text, bool force) {
  if (file == "-") return StandardOutput(file).write(text);
  catch_signals();  // the file is whole before they count
  if (force)
    write_whole(file, text);
  else
    make_new(file, text);
  fmt::print("written: {0}\nnext: tether run {0}\n", on_terminal(file));
}

}  // namespace tether::scene
