// Tether: a table with any number of rows at a time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fstream>
#include <memory>
#include <string>

#include "output/output_names.hpp"
#include "output/row_file.hpp"

namespace tether::scene {

/// Rows that begin with their time. Throws std::runtime_error where the file cannot be written.
class LongTable {
 public:
  /// `keep(row)`: whether a row of an earlier run of the same head stays; the first one that does
  /// not ends them.
  template <class Keep>
  LongTable(const std::string& file, const std::string& head, bool restarted, Keep keep) {
    std::size_t kept = 0;
    std::string line;
    std::ifstream in;
    if (restarted && !is_device(file)) in.open(file, std::ios::binary);
    if (in.is_open() && std::getline(in, line) && line + '\n' == head) {
      kept = head.size();
      while (std::getline(in, line) && !in.eof() && keep(line)) kept += line.size() + 1;
    }
    rows_ = std::make_unique<RowFile>(file, kept);
    if (kept == 0) put(head);
  }

  void put(const std::string& rows) { rows_->put(rows); }
  void flush() { rows_->flush(); }
  void keep() { rows_->keep(); }
  const std::string& file() const { return rows_->name(); }

 private:
  std::unique_ptr<RowFile> rows_;
};

}  // namespace tether::scene
