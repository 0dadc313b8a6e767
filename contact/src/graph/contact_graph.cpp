// Tether: islands of bodies in contact, and the order in which their contacts are swept.
// SPDX-License-Identifier: BSD-3-Clause

#include "graph/contact_graph.hpp"

#include <algorithm>
#include <limits>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {
namespace {

using linalg::at;

// A chunk has about 1/128 of its island, so that a colour holds several for each thread, within
// limits: call overhead below, first-level cache above.
constexpr int kLeast = 64, kMost = 384;

constexpr int kOneChunk = 256;  // up to this an island is one chunk

// Number of colours in the bit masks of chunks; chunks beyond get a colour of their own.
constexpr int kMasked = std::numeric_limits<std::int64_t>::digits;

}  // namespace

void IslandFinder::find(int bodies, const ContactPairs& pairs, std::vector<Island>& islands,
                        std::vector<int>& sorted, std::vector<int>& island_of_contact) {
  const std::vector<int>&first = *pairs.first, &second = *pairs.second;
  const std::size_t n = first.size();
  sets_.reset(bodies);
  for (std::size_t i = 0; i < n; ++i)
    if (second[i] >= 0) sets_.join(first[i], second[i]);
  island_of_.assign(at(bodies), -1);
  island_of_contact.resize(n);
  islands.clear();
  for (std::size_t i = 0; i < n; ++i) {
    int& island = island_of_[at(sets_.root(first[i]))];
    if (island < 0) {
      island = static_cast<int>(islands.size());
      islands.push_back({});
    }
    ++islands[at(island)].contacts;
    island_of_contact[i] = island;
  }
  int begin = 0;
  for (Island& island : islands) {
    island.contact_begin = begin;
    begin += island.contacts;
  }
  sorted.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    sorted[at(islands[at(island_of_contact[i])].contact_begin++)] = static_cast<int>(i);
  }
  for (Island& island : islands) island.contact_begin -= island.contacts;
}

void Adjacency::build(int bodies, const ContactPairs& pairs) {
  const std::vector<int>&first = *pairs.first, &second = *pairs.second;
  const std::size_t n = first.size();
  start_.assign(at(bodies) + 1, 0);
  const auto count = [&](int b) {
    if (b >= 0) ++start_[at(b)];
  };
  for (std::size_t i = 0; i < n; ++i) count(first[i]), count(second[i]);
  int sum = 0;
  for (int& start : start_) sum += start, start = sum;
  all_.resize(at(sum));
  for (std::size_t i = n; i-- > 0;) {
    all_[at(--start_[at(first[i])])] = static_cast<int>(i);
    if (second[i] >= 0) all_[at(--start_[at(second[i])])] = static_cast<int>(i);
  }
}

// Contacts of the one body and of the other, those between the two once.
void Adjacency::coupled(const ContactPairs& pairs, const std::vector<int>& bodies,
                        const std::vector<int>& order, std::vector<float>& out) {
  between_.assign(start_.size() - 1, 0);
  count_.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    count_[i] = static_cast<float>(count((*pairs.first)[i]));
  for (int b : bodies) {
    for (const int* c = begin(b); c < end(b); ++c)
      if (pairs.across(*c, b) >= 0) ++between_[at(pairs.across(*c, b))];
    for (const int* c = begin(b); c < end(b); ++c) {
      const int other = pairs.other(*c);
      if (pairs.one(*c) != b || other < 0) continue;
      count_[at(*c)] += static_cast<float>(count(other) - between_[at(other)]);
    }
    for (const int* c = begin(b); c < end(b); ++c)
      if (pairs.across(*c, b) >= 0) between_[at(pairs.across(*c, b))] = 0;
  }
  out.resize(order.size());
  for (std::size_t place = 0; place < order.size(); ++place) out[place] = count_[at(order[place])];
}

void Clusters::reset(int bodies, int contacts) {
  mark_.assign(at(bodies), -1);
  taken_.resize(at(contacts));
}

void Clusters::find(const Island& island, const ContactPairs& pairs, const Adjacency& adjacent,
                    int* contacts, std::vector<int>& slot, std::vector<int>& body) {
  const int size = std::max(kLeast, std::min(kMost, island.contacts / 128));
  for (int k = 0; k < island.contacts; ++k) taken_[at(contacts[k])] = 0;
  start_.clear();
  far_.clear();
  far_.push_back(pairs.one(contacts[0]));
  int taken = 0;  // contacts are written back in the order of the clusters
  for (std::size_t seed = 0; seed < far_.size(); ++seed) {
    if (slot[at(far_[seed])] >= 0) continue;
    const int chunk = static_cast<int>(start_.size()), start = taken;
    near_.clear();
    near_.push_back(far_[seed]);
    mark_[at(far_[seed])] = chunk + island.chunk_begin;
    std::size_t next = 0;
    while (next < near_.size() && taken - start < size) {
      const int b = near_[next++];
      slot[at(b)] = static_cast<int>(body.size());
      body.push_back(b);
      for (const int* k = adjacent.begin(b); k < adjacent.end(b); ++k) {
        const int c = *k;
        if (!taken_[at(c)]) {
          taken_[at(c)] = 1;
          contacts[taken++] = c;
        }
        const int other = pairs.across(c, b);
        if (other < 0 || slot[at(other)] >= 0 || mark_[at(other)] == chunk + island.chunk_begin)
          continue;
        mark_[at(other)] = chunk + island.chunk_begin;
        near_.push_back(other);
      }
    }
    far_.insert(far_.end(), near_.begin() + static_cast<std::ptrdiff_t>(next), near_.end());
    if (taken > start) start_.push_back(start);
  }
  start_.push_back(taken);
}

void ChunkColours::colour(const Clusters& clusters, const ContactPairs& pairs, const int* contacts,
                          std::vector<std::uint64_t>& used_of) {
  const int n = clusters.size();
  colour_.resize(at(n));
  int extra = kMasked, used_colours = 0, load[kMasked] = {};
  for (int c = 0; c < n; ++c) {
    std::uint64_t taken = 0;
    const auto over_bodies = [&](auto&& f) {
      for (int k = clusters.begin(c); k < clusters.end(c); ++k) {
        f(used_of[at(pairs.one(contacts[k]))]);
        const int b = pairs.other(contacts[k]);
        if (b >= 0) f(used_of[at(b)]);
      }
    };
    over_bodies([&](std::uint64_t& used) { taken |= used; });
    int colour = -1;
    for (int k = 0; k < used_colours; ++k) {
      if (!(taken >> k & 1) && (colour < 0 || load[k] < load[colour])) colour = k;
    }
    if (colour < 0) colour = used_colours < kMasked ? used_colours++ : extra++;
    colour_[at(c)] = colour;
    if (colour >= kMasked) continue;
    load[colour] += clusters.end(c) - clusters.begin(c);
    over_bodies([&](std::uint64_t& used) { used |= std::uint64_t{1} << colour; });
  }
  // Colour by colour, chunks in their order.
  begin_.resize(at(extra + 1));
  std::fill(begin_.begin(), begin_.end(), 0);
  for (int c = 0; c < n; ++c) ++begin_[at(colour_[at(c)] + 1)];
  for (int colour = 0; colour < extra; ++colour) begin_[at(colour + 1)] += begin_[at(colour)];
  sequence_.resize(at(n));
  for (int c = 0; c < n; ++c) sequence_[at(begin_[at(colour_[at(c)])]++)] = c;
}

// Every contact joins the first open group of its kind that none of its bodies is in.
void ContactsByKind::sort(const int* begin, const int* end, const ContactPairs& pairs,
                          const std::vector<Kind>& kind, bool in_fours,
                          std::vector<std::uint64_t>& used) {
  for (std::vector<int>& list : lists_) {
    list.clear();
    list.reserve(at(kMost));  // once: which kind has how many changes from step to step
  }
  if (in_fours && end - begin >= 4) {
    group(begin, end, pairs, kind, used);
    return;
  }
  for (const int* c = begin; c < end; ++c) lists_[static_cast<int>(kind[at(*c)])].push_back(*c);
}

void ContactsByKind::group(const int* begin, const int* end, const ContactPairs& pairs,
                           const std::vector<Kind>& kind_of, std::vector<std::uint64_t>& used_of) {
  constexpr int kOpen = 16;  // groups of each kind that wait for members
  const std::vector<int>&first = *pairs.first, &second = *pairs.second;
  int members[2][kOpen][4], size[2][kOpen] = {};
  for (const int* c = begin; c < end; ++c) {
    used_of[at(first[at(*c)])] = 0;
    if (second[at(*c)] >= 0) used_of[at(second[at(*c)])] = 0;
  }
  const auto mark = [&](int c, std::uint64_t bit, bool in) {
    for (int b : {first[at(c)], second[at(c)]}) {
      if (b < 0) continue;
      std::uint64_t& used = used_of[at(b)];
      used = in ? used | bit : used & ~bit;
    }
  };
  for (const int* p = begin; p < end; ++p) {
    const int c = *p;
    const Kind kind = kind_of[at(c)];
    std::vector<int>& single = lists_[static_cast<int>(kind)];
    if (kind == Kind::smooth) {
      single.push_back(c);
      continue;
    }
    const int type = kind == Kind::sphere ? 1 : 0, shift = type * kOpen;
    std::uint64_t taken = used_of[at(first[at(c)])];
    if (second[at(c)] >= 0) taken |= used_of[at(second[at(c)])];
    int g = 0;
    while (g < kOpen && (taken >> (shift + g) & 1)) ++g;
    if (g == kOpen) {
      single.push_back(c);
      continue;
    }
    const std::uint64_t bit = std::uint64_t{1} << (shift + g);
    members[type][g][size[type][g]++] = c;
    if (size[type][g] < 4) {
      mark(c, bit, true);
      continue;
    }
    std::vector<int>& full = lists_[static_cast<int>(type ? Kind::sphere4 : Kind::general4)];
    for (int m : members[type][g]) {
      full.push_back(m);
      mark(m, bit, false);
    }
    size[type][g] = 0;
  }
  for (int type = 0; type < 2; ++type) {
    std::vector<int>& single = lists_[static_cast<int>(type ? Kind::sphere : Kind::general)];
    for (int g = 0; g < kOpen; ++g) {
      for (int m = 0; m < size[type][g]; ++m) single.push_back(members[type][g][m]);
    }
  }
}

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
