// Tether: which rank sweeps which contacts, and who tells whom. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "graph/contact_graph.hpp"

namespace tether::contact::detail {

// Slots of the part whose velocities go to, and come from, another rank; the other one has the same
// bodies in the same order.
struct RankExchange {
  int rank;
  std::vector<int> send, receive;
};
using RankExchanges = std::vector<RankExchange>;  // ascending ranks

// The graph of all contacts, made alike by all ranks, and the part of one: its chunks, with the
// numbers that contacts and bodies have in the whole.
//
// A chunk goes to the rank that owns most of its contacts (the owner of the moving body with the
// smaller number), an island that would not be worth several threads as a whole. Where one rank has
// more of a colour than others, chunks near them move: all ranks wait after each colour.
//
// A body that several ranks move has a rank that sweeps it next, after each of the colours, and one
// that sweeps it first, its home, where its velocity is between sweeps.
class RankPlan {
 public:
  // first, second, kinds: as ContactGraph::build has them. owner: rank of each body.
  void build(const std::vector<int>& first, const std::vector<int>& second,
             const std::vector<Kind>& kinds, const std::vector<int>& owner, int ranks, int rank);

  int count(int chunk) const;  // contacts of a chunk of `whole`

  ContactGraph whole, part;
  std::vector<int> contact_rank, home;  // of all contacts, bodies
  std::vector<int> chunk_rank;          // of the chunks of `whole`
  std::vector<int> chunk_of;            // chunk of `part` -> of `whole`
  std::vector<char> shared, here;       // of the islands

  std::vector<RankExchanges> after;  // each colour of `part`
  std::vector<RankExchanges> share;  // of each island: from home to others

  int ranks = 1, rank = 0;

 private:
  void assign(const std::vector<int>& owner);
  std::vector<int> owned(int begin, int end, const std::vector<int>& owner) const;
  void balance(int begin, int end, const std::vector<int>& owner);
  void select();
  void take_chunk(int chunk);
  void exchanges(int island);
  template <class Visit>
  void for_bodies(int chunk, const Visit& visit) const;

  ContactPairs pairs_;
  std::vector<int> last_rank_, last_colour_;  // of bodies, while exchanges are found
};

}  // namespace tether::contact::detail
