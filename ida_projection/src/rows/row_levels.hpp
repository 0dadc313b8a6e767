// Tether: which columns rows are there for. SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
std::vector<int> levels_of_columns(const RowPattern& rows);

}  // namespace tether::ida_projection
