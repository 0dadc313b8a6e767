// Tether: forces of springs and dampers by tables. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

namespace tether::scene::effects {

/// Rows of a stretch or speed and its force, which begin behind a row of zeros and are joined by
/// straight pieces; behind the last one the force stays.
using ForceTable = std::vector<std::array<double, 2>>;

inline double slope(const std::array<double, 2>& from, const std::array<double, 2>& to) {
  return (to[1] - from[1]) / (to[0] - from[0]);
}

/// f(from, to): the rows at the ends of each piece.
template <class F>
void each_piece(const ForceTable& table, const F& f) {
  std::array<double, 2> from{0, 0};
  for (const std::array<double, 2>& to : table) {
    f(from, to);
    from = to;
  }
}

}  // namespace tether::scene::effects
