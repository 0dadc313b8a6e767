// Tether: what files of contact problems say. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <tether/contact/files.hpp>
#include <vector>

namespace tether::contact::detail {

struct FileMatrix {
  long rows = 0, columns = 0;
  std::vector<MatrixEntry> entries;

  FileMatrix transposed() const {
    FileMatrix out{columns, rows, {}};
    for (const MatrixEntry& e : entries) out.entries.push_back({e.column, e.row, e.value});
    return out;
  }
  /// Entries of `block`, moved to begin at a row and a column.
  void put(const FileMatrix& block, int row, int column) {
    for (const MatrixEntry& e : block.entries)
      entries.push_back({row + e.row, column + e.column, e.value});
  }
};

/// Rows of contacts, `dimension` for each, then those of joints, y:
///
///     local    w = A (x, y) + q
///     global   A v = J'(x, y) + f,   w = J v + q
struct FileProblem {
  int dimension = 3;  ///< 2; 3; 5: with moments of rolling friction
  int joints = 0;
  FileMatrix A;
  std::optional<FileMatrix> J;  ///< of a global one
  linalg::VectorX f, q, mu, rolling;

  bool is_local() const { return !J; }
  int contacts() const { return static_cast<int>(mu.size()); }
  int rows() const { return dimension * contacts() + joints; }
};

FileProblem read_dat(const std::string& path);
FileProblem read_fclib(const std::string& path);

}  // namespace tether::contact::detail
