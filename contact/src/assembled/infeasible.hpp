// Tether: the proof that a contact problem has no solution (method, section 3.4).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/search.hpp"

namespace tether::contact::detail {

// Looks for normal impulses d with d_n >= 0, d_t = 0, A d = 0 (to round-off) and b.d > tolerance
// times the velocity scale times the sum of d, in one island. With them d.w = -b.d for all
// impulses, so that no impulses, of any law, make every w_n >= 0 (method, section 3.4). Work is
// counted in `search`. False: none was found.
bool proves_infeasible(Search& search, Packed& d);

}  // namespace tether::contact::detail
