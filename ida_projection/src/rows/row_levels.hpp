// Tether: which columns rows are there for. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace tether::ida_projection {

/// The columns of each row, columns[starts[i] .. starts[i + 1] - 1], among n unknowns.
struct RowPattern {
  std::vector<int> starts = {0}, columns;
  int n = 0;
};

/// Level of each of n columns; -1: no row has it. A row whose columns are some of those of another
/// one fixes these by itself: the other one is there for the rest. So position rows have positions
/// (level 0), velocity rows positions and velocities (these are of level 1), rows of accelerations
/// all three.
std::vector<int> levels_of_columns(const RowPattern& rows);

}  // namespace tether::ida_projection
