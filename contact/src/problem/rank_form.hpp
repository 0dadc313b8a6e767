// Tether: a factor of a dense Delassus matrix of small rank. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "problem/body_form.hpp"
#include "tether/contact/problem.hpp"

namespace tether::contact::detail {

/// A = H H' by Cholesky's decomposition with diagonal pivots, three columns of H a node: what many
/// contacts of one mechanism have in common is its few freedoms. None where the rank is above
/// most_rank; a look that ends so takes 3 contacts most_rank^2 operations.
std::shared_ptr<const BodyForm> rank_form(const Problem& problem, int most_rank);

}  // namespace tether::contact::detail
