// Tether: tables that end with a whole row. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tether::scene {

/// A file to which whole rows are added. Where the disk is full or the run ends early it is cut
/// back to its last whole row; rows leave together, so that a run that is killed leaves whole ones,
/// too.
class RowFile {
 public:
  /// Makes its folder. The first `kept` bytes of a file that is there stay and are safe at every
  /// instant; 0: it is a new one. Throws std::runtime_error, as all of these.
  RowFile(std::string file, std::size_t kept);
  ~RowFile();
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;

  /// One or more rows, each with its end.
  void put(std::string_view rows);
  void flush();
  /// Makes what was put outlast a loss of power.
  void keep();
  const std::string& name() const { return file_; }

 private:
  [[noreturn]] void fail();

  std::string file_, waiting_;
  int descriptor_;
  std::size_t size_;  // of the rows in the file
};

}  // namespace tether::scene
