// Tether: what an import left out or changed. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

namespace tether::scene::import {

/// One line for each kind of thing, with the names of all that it concerns.
class Remarks {
 public:
  void add(const std::string& what, const std::string& name = "");
  bool empty() const { return lines_.empty(); }
  /// "what: a, b, c" or "what (3)", in the order of their first appearance.
  std::vector<std::string> lines() const;

 private:
  struct Line {
    std::string what;
    std::vector<std::string> names;
    long count = 0;
  };
  std::vector<Line> lines_;
  std::map<std::string, std::size_t> index_;
};

}  // namespace tether::scene::import
