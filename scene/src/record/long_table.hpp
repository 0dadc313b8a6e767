// Tether: a table with any number of rows at a time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

#include "output/whole_file.hpp"

namespace tether::scene {

/// Rows that begin with their time. Throws std::runtime_error where the file cannot be written.
class LongTable {
 public:
  /// `keep(row)`: whether a row of an earlier run of the same head stays; the first one that does
  /// not ends them.
  template <class Keep>
  LongTable(std::string file, const std::string& head, bool restarted, const Keep& keep)
      : file_(std::move(file)) {
    std::string rows;
    if (restarted) {
      std::ifstream in(file_, std::ios::binary);
      std::string line;
      std::getline(in, line);
      while (std::getline(in, line) && !in.eof() && keep(line)) rows += line + '\n';
    }
    make_folder_of(file_);
    out_.open(file_, std::ios::binary | std::ios::trunc);
    put(head);
    put(rows);
  }

  void put(const std::string& text) {
    out_ << text;
    demand_good();
  }
  void flush() {
    out_.flush();
    demand_good();
  }
  const std::string& file() const { return file_; }

 private:
  void demand_good() const {
    if (!out_)
      throw std::runtime_error(fmt::format("cannot write {}: {}", file_, std::strerror(errno)));
  }
  std::string file_;
  std::ofstream out_;
};

}  // namespace tether::scene
