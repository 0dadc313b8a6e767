// Tether: which columns rows are there for. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace tether::ida_projection {

/// Level of each of n columns; -1: no row has it. A row whose columns are some of those of another
/// one fixes these by itself: the other one is there for the rest. So position rows have positions
/// (level 0), velocity rows positions and velocities (these are of level 1), rows of accelerations
/// all three. Row i has the columns columns[starts[i] .. starts[i + 1] - 1].
std::vector<int> levels_of_columns(const std::vector<int>& starts, const std::vector<int>& columns,
                                   int n);

}  // namespace tether::ida_projection
