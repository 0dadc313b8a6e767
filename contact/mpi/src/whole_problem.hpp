// Tether: what every rank knows of all bodies and contacts. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "messages.hpp"

namespace tether::contact_mpi::detail {

/// Owners, traits and ends of contacts: 5 bytes a body and 16 a contact, the same on all ranks.
struct WholeProblem {
  std::vector<int> owner;                      // rank of each body
  std::vector<std::uint8_t> traits;            // contact::rank_traits
  std::vector<contact::RankContact> contacts;  // in the order that the numbers of bodies give
  std::vector<int> giver;                      // the rank that has given each contact
  std::vector<int> mine;                       // contacts of this rank, as given -> number
};

/// Throws, on all ranks, what one of them refuses.
WholeProblem whole_problem(Messages& messages, const Share& share, contact::Law law);

/// Throws on all ranks unless all have the same options.
void require_same(Messages& messages, const Options& options);

}  // namespace tether::contact_mpi::detail
