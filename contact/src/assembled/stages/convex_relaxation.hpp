// Tether: the convex relaxation of a contact problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/search.hpp"

namespace tether::contact::detail {

// min 1/2 x'Ax - b'x over the product of the cones, complementarity dropped: always solvable, but
// sliding contacts separate (w_n = mu |w_t|). Accelerated projected gradient with restart. Returns
// true when its own residual |x - P_K(x - grad)| / |b| reached the tolerance; x is the answer.
bool solve_convex_relaxation(Search& search, Packed& x);

}  // namespace tether::contact::detail
