// Tether: unknowns that rows would determine as they do forces. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

namespace tether::ida_projection {

/// The columns of each row, columns[starts[i] .. starts[i + 1] - 1], among n unknowns.
struct RowPattern {
  std::vector<int> starts = {0}, columns;
  int n = 0;
};

/// Unknowns that may be forces, and what they would act on: rows of accelerations contain rows of
/// velocities, and these contain rows of positions. Patterns alone do not tell: with norms of
/// quaternions, which stand in every other row, the positions of a joint look like velocities and
/// velocities like forces. F tells, see start/forces.hpp.
struct RowChain {
  std::vector<int> forces, velocities, positions;
  /// Unknowns that only one row with forces, or one row of velocities, contains.
  std::vector<std::vector<int>> forces_of_rows, velocities_of_rows;
};

/// Does F say that the chain is one?
using AreForces = std::function<bool(const RowChain&)>;

/// The chain whose forces are the unknowns of level `first` and above (row_levels.hpp). False:
/// there is none, or it has not as many rows with forces as forces.
bool find_chain(const RowPattern& rows, const std::vector<int>& levels, int first, RowChain* chain);

}  // namespace tether::ida_projection
