// Tether: order and fill of a symmetric elimination, before there are numbers.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/block3.hpp>
#include <vector>

namespace tether::linalg {

// Approximate minimum degree (Amestoy, Davis, Duff, SIAM J. Matrix Anal. 17 (1996), 886): entry k
// of the result is eliminated k-th.
std::vector<int> minimum_degree_order(const BlockPattern& pattern);

// rows[starts[k] .. starts[k + 1]), ascending: rows of column k of the factor below its diagonal,
// for the elimination of order[0], order[1], ...; position is its inverse, -1 for rows that take no
// part.
void find_fill(const BlockPattern& pattern, const std::vector<int>& order,
               const std::vector<int>& position, std::vector<int>& starts, std::vector<int>& rows);

// Lists of columns, n rows, turned into lists of rows, ascending (or the other way round).
void transpose(int n, const std::vector<int>& starts, const std::vector<int>& columns,
               std::vector<int>& row_starts, std::vector<int>& rows);

}  // namespace tether::linalg
