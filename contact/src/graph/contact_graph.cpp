// Tether: islands of bodies in contact, and the order in which their contacts are swept.
// SPDX-License-Identifier: BSD-3-Clause
#include "graph/contact_graph.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {
namespace {

using linalg::at;

constexpr int kOneChunk = 256;  // up to this an island is one chunk

}  // namespace

void ContactGraph::build(int bodies, const std::vector<int>& first, const std::vector<int>& second,
                         const std::vector<Kind>& kind, bool in_fours) {
  in_fours_ = in_fours;
  pairs_ = {&first, &second};
  kind_ = &kind;
  finder_.find(bodies, pairs_, islands, sorted_, order);  // order: in another use here
  adjacent_.build(bodies, pairs_);
  slot.assign(at(bodies), -1);
  body.clear();
  chunks.clear();
  colours.clear();
  used_.assign(at(bodies), 0);
  if (std::any_of(islands.begin(), islands.end(),
                  [](const Island& island) { return island.contacts > kOneChunk; }))
    clusters_.reset(bodies, pairs_.size());
  // Places of each kind: running counts over the chunks, filled by append_chunk.
  chunks.push_back({});
  for (Island& island : islands) {
    island.body_begin = static_cast<int>(body.size());
    island.chunk_begin = static_cast<int>(chunks.size()) - 1;
    island.colour_begin = static_cast<int>(colours.size());
    if (island.contacts <= kOneChunk)
      one_chunk(island);
    else
      many_chunks(island);
    island.body_end = static_cast<int>(body.size());
    island.chunk_end = static_cast<int>(chunks.size()) - 1;
    island.colour_end = static_cast<int>(colours.size());
    colours.push_back(island.chunk_end);
  }
  adjacent_.coupled(pairs_, body, order, coupled);
}

void ContactGraph::one_chunk(Island& island) {
  int* contacts = sorted_.data() + island.contact_begin;
  for (int k = 0; k < island.contacts; ++k) {
    for (int b : {pairs_.one(contacts[k]), pairs_.other(contacts[k])}) {
      if (b < 0 || slot[at(b)] >= 0) continue;
      slot[at(b)] = static_cast<int>(body.size());
      body.push_back(b);
    }
  }
  colours.push_back(island.chunk_begin);
  append_chunk(contacts, contacts + island.contacts, island.contact_begin);
}

// Colour by colour, chunks in their order.
void ContactGraph::many_chunks(Island& island) {
  int* contacts = sorted_.data() + island.contact_begin;
  clusters_.find(island, pairs_, adjacent_, contacts, slot, body);
  chunk_colours_.colour(clusters_, pairs_, contacts, used_);
  int place = island.contact_begin, colour = -1;
  for (int c : chunk_colours_.sequence()) {
    if (chunk_colours_.of(c) != colour) {
      colour = chunk_colours_.of(c);
      colours.push_back(static_cast<int>(chunks.size()) - 1);
    }
    append_chunk(contacts + clusters_.begin(c), contacts + clusters_.end(c), place);
    place += clusters_.end(c) - clusters_.begin(c);
  }
}

void ContactGraph::append_chunk(const int* begin, const int* end, int place) {
  Chunk next = chunks.back();
  next.place = place + static_cast<int>(end - begin);
  by_kind_.sort(begin, end, pairs_, *kind_, in_fours_, used_);
  for (int k = 0; k < kKinds; ++k) {
    for (int c : by_kind_.of(k)) order[at(place++)] = c;
    next.begin[k] += static_cast<int>(by_kind_.of(k).size());
  }
  chunks.push_back(next);
}

}  // namespace tether::contact::detail
