// Tether: which rank sweeps which contacts, and who tells whom. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/ranks.hpp>
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

// The graph of all contacts, made alike by all ranks, and the part of one.
//
// A chunk goes to the rank that owns most of its contacts (the owner of the moving body with the
// smaller number), an island that would not be worth several threads as a whole. Where one rank has
// more of a colour than others, chunks near them move: all ranks wait after each colour.
//
// A body that several ranks move has a rank that sweeps it next, after each of the colours, and one
// that sweeps it first, its home, where its velocity is between sweeps.
class RankPlan {
 public:
  void build(const std::vector<RankContact>& contacts, const std::vector<int>& owner, int ranks,
             int rank);

  ContactGraph whole, part;
  std::vector<int> first, second;  // of all contacts
  std::vector<int> contacts;       // place in the lists of this rank -> contact
  std::vector<int> bodies;         // the same of bodies: those of slots, then those that are fixed
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
  void select(const std::vector<RankContact>& links, int bodies);
  void exchanges(int island);
  int count(int chunk) const;
  template <class Visit>
  void for_bodies(int chunk, const Visit& visit) const;

  std::vector<int> slot_;                     // body -> place in `bodies`, -1: none
  std::vector<int> last_rank_, last_colour_;  // of bodies, while exchanges are found
};

// A graph of some chunks of another one; islands keep their numbers and their count of contacts.
struct ChunkSelection {
  ContactGraph& part;
  std::vector<int>&contacts, &bodies, &chunks;  // place in the part -> in the whole
};
// wanted: of each chunk of `from`; first, second: of its contacts. Bodies: in the order of slots.
void select_chunks(const ContactGraph& from, const std::vector<int>& first,
                   const std::vector<int>& second, const std::vector<char>& wanted,
                   const ChunkSelection& out);

}  // namespace tether::contact::detail
