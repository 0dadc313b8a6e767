// Tether: what an import left out or changed. SPDX-License-Identifier: BSD-3-Clause
#include "import/robot/remarks.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tether::scene::import {

namespace {

constexpr std::size_t kMostNames = 10000;  // of a line

}  // namespace

void Remarks::add(const std::string& what, const std::string& name) {
  const auto [found, is_new] = index_.emplace(what, lines_.size());
  if (is_new) lines_.push_back({what, {}, 0});
  Line& line = lines_[found->second];
  ++line.count;
  if (!name.empty() && line.names.size() < kMostNames) line.names.push_back(name);
}

std::vector<std::string> Remarks::lines() const {
  std::vector<std::string> out;
  for (const Line& line : lines_) {
    std::vector<std::string> names = line.names;
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    if (!names.empty())
      out.push_back(fmt::format("{}: {}{}", line.what, fmt::join(names, ", "),
                                line.names.size() < kMostNames ? "" : ", ..."));
    else
      out.push_back(line.count > 1 ? fmt::format("{} ({} times)", line.what, line.count)
                                   : line.what);
  }
  return out;
}

}  // namespace tether::scene::import
