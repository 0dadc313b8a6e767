// Tether: an order of elimination for the matrix of a smooth system. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

namespace tether::scene::smooth {

/// Which unknown comes when, for little fill and pivots on the diagonal. First the coordinates of
/// all bodies: of their columns, pivots cj I, only the velocities of the same body are filled, and
/// what is left has half the width. Then velocities, bodies in approximate minimum degree order of
/// the graph that joints and springs make of them, each multiplier behind the later of its bodies
/// (there its pivot, -G M^-1 G^T less what multipliers before it have of that, is not zero);
/// whatever else there is behind all.
///
/// `places`: (row, column) of each entry, `width` unknowns for each of so many bodies first, of
/// each the `coordinates` before the rest.
std::vector<int> elimination_order(int unknowns, int bodies, int width, int coordinates,
                                   const std::vector<std::pair<int, int>>& places);

}  // namespace tether::scene::smooth
