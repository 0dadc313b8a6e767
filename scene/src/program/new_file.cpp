// Tether: files that are not there yet. SPDX-License-Identifier: BSD-3-Clause
#include "new_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "output/whole_file.hpp"

namespace tether::scene {

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

}  // namespace tether::scene
