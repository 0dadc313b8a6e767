// Tether: which columns rows are there for. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <vector>

namespace tether::ida_projection {

/// The columns of each row, columns[starts[i] .. starts[i + 1] - 1], among n unknowns.
struct RowPattern {
  std::vector<int> starts = {0}, columns;
  int n = 0;
};

/// Level of each of n columns; -1: no row contains it. If the columns of a row are a subset of
/// those of another row, the other row determines the remaining columns, which are one level
/// higher. So positions, in position rows, have level 0; velocities, which velocity rows contain
/// besides positions, have level 1; accelerations have level 2.
inline std::vector<int> levels_of_columns(const RowPattern& rows) {
  using linalg::at;
  const std::vector<int>&starts = rows.starts, &columns = rows.columns;
  const int n = rows.n;
  const int m = static_cast<int>(starts.size()) - 1;
  const auto size = [&](int i) { return starts[at(i + 1)] - starts[at(i)]; };
  const auto all_of = [&](int i, auto holds) {
    return std::all_of(columns.begin() + starts[at(i)], columns.begin() + starts[at(i + 1)], holds);
  };
  std::vector<std::vector<int>> with_first(at(n));  // rows by their first column
  for (int i = 0; i < m; ++i)
    if (size(i) > 0) with_first[at(columns[at(starts[at(i)])])].push_back(i);
  std::vector<int> shortest_first(at(m));
  std::iota(shortest_first.begin(), shortest_first.end(), 0);
  std::stable_sort(shortest_first.begin(), shortest_first.end(),
                   [&](int i, int k) { return size(i) < size(k); });

  std::vector<int> depths(at(m), 0), owners(at(n), -1), levels(at(n), -1);
  for (const int i : shortest_first) {
    int& depth = depths[at(i)];
    all_of(i, [&](int j) { return owners[at(j)] = i, true; });
    all_of(i, [&](int j) {
      for (const int k : with_first[at(j)])
        if (size(k) < size(i) && depths[at(k)] >= depth &&
            all_of(k, [&](int column) { return owners[at(column)] == i; }))
          depth = depths[at(k)] + 1;
      return true;
    });
  }
  for (const int i : shortest_first)
    all_of(i, [&](int j) {
      int& level = levels[at(j)];
      level = level < 0 ? depths[at(i)] : std::min(level, depths[at(i)]);
      return true;
    });
  return levels;
}

}  // namespace tether::ida_projection
