// Tether: what a run writes. SPDX-License-Identifier: BSD-3-Clause
#include "output_names.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>
#include <stdexcept>

namespace tether::scene {

namespace fs = std::filesystem;

std::string one_name(const std::string& file) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(fs::absolute(file, error), error);
  return error ? file : whole.string();
}

bool names_file(const std::string& path) {
  const fs::path name = fs::path(path).filename();
  return !name.empty() && name != "." && name != "..";
}

std::string identity(const std::string& file) {
  struct stat there {};
  if (stat(file.c_str(), &there) == 0 && S_ISREG(there.st_mode))
    return fmt::format("file {} of device {}", there.st_ino, there.st_dev);
  return one_name(file);
}

bool is_device(const std::string& file) {
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  return fs::exists(there) && !fs::is_regular_file(there) && !fs::is_directory(there);
}

std::vector<std::string> inputs_of(const Scene& scene) {
  std::vector<std::string> out = scene.surface_files;
  out.push_back(scene.file);
  return out;
}

void check_page_name(const std::string& html, const std::vector<std::string>& others) {
  if (!names_file(html))
    throw std::invalid_argument(fmt::format("html = \"{}\": must name a file", html));
  if (is_device(html)) return;
  for (const std::string& each : others)
    for (const char* with : {"", ".new", ".lock"})
      if (!each.empty() &&
          (identity(each + with) == identity(html) || identity(html + with) == identity(each)))
        throw std::invalid_argument(
            fmt::format("html = \"{}\": this file is an input or another output", html));
}

}  // namespace tether::scene
