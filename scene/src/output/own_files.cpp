// Tether: how files of Tether begin. SPDX-License-Identifier: BSD-3-Clause
#include "own_files.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <stdexcept>
#include <string_view>

namespace tether::scene {

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
