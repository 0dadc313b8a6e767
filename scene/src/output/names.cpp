// Tether: what a run writes. SPDX-License-Identifier: BSD-3-Clause
#include "names.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <initializer_list>
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

namespace {

constexpr std::size_t kLongestHead = std::size_t{1} << 16;  // bytes; of a sweep over many numbers

bool is_own(std::string_view head) {
  for (const std::string_view own :
       {kRecordsHead, kEventsHead, kContactsHead, kCostHead, kStateHead})
    if (head.substr(0, own.size()) == own) return true;
  const std::string_view mark = kMarkup, line = head.substr(0, head.find('\n'));
  if (line.find(kSweepHead) != std::string_view::npos) return true;
  const std::size_t at = head.find(mark);
  return (line.substr(0, 5) == "<?xml" || line == "<!DOCTYPE html>") && at == line.size() + 1;
}

}  // namespace

void check_replaceable(const std::string& file) {
  namespace fs = std::filesystem;
  for (const char* with : {"", ".new"}) {
    const std::string name = file + with;
    std::error_code error;
    if (!fs::is_regular_file(name, error)) continue;
    std::ifstream in(name, std::ios::binary);
    std::string head(kLongestHead, '\0');
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(in.gcount()));
    if ((in.eof() && head.empty()) || is_own(head)) continue;
    throw std::invalid_argument(
        fmt::format("{} is there and was not written by Tether: --force replaces it", name));
  }
}

}  // namespace tether::scene
