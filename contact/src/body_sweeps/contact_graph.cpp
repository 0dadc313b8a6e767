// Tether: islands of bodies in contact, and the order in which their contacts are swept.
// SPDX-License-Identifier: BSD-3-Clause
#include "body_sweeps/contact_graph.hpp"

#include <algorithm>

namespace tether::contact::detail {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Up to this an island is one chunk. Larger ones get chunks of about 1/128 of the island, so that a
// colour holds several for each thread, within limits: call overhead below, first-level cache
// above.
constexpr int kOneChunk = 256, kLeast = 64, kMost = 384;

// Number of colours in the bit masks of chunks; chunks beyond get a colour of their own.
constexpr int kMasked = 63;

}  // namespace

int ContactGraph::root(int b) {
  while (parent_[at(b)] != b) b = parent_[at(b)] = parent_[at(parent_[at(b)])];
  return b;
}

void ContactGraph::build(int bodies, const std::vector<int>& first, const std::vector<int>& second,
                         const std::vector<Kind>& kind, bool in_fours) {
  in_fours_ = in_fours;
  first_ = &first;
  second_ = &second;
  kind_ = &kind;
  const std::size_t n = first.size();
  find_islands(bodies);

  slot.assign(at(bodies), -1);
  body.clear();
  chunks.clear();
  colours.clear();
  used_.assign(at(bodies), 0);
  bool large = false;
  for (const Island& island : islands) large = large || island.contacts > kOneChunk;
  adjacent_start_.assign(at(bodies) + 1, 0);
  const auto count = [&](int b) {
    if (b >= 0) ++adjacent_start_[at(b)];
  };
  for (std::size_t i = 0; i < n; ++i) count(first[i]), count(second[i]);
  int sum = 0;
  for (int& start : adjacent_start_) sum += start, start = sum;
  adjacent_.resize(at(sum));
  for (std::size_t i = n; i-- > 0;) {
    adjacent_[at(--adjacent_start_[at(first[i])])] = static_cast<int>(i);
    if (second[i] >= 0) adjacent_[at(--adjacent_start_[at(second[i])])] = static_cast<int>(i);
  }
  if (large) {
    mark_.assign(at(bodies), -1);
    taken_.resize(n);
  }
  // Places of each kind: running counts over the chunks, filled by order_within.
  chunks.push_back({});
  for (Island& island : islands) {
    island.body_begin = static_cast<int>(body.size());
    island.chunk_begin = static_cast<int>(chunks.size()) - 1;
    island.colour_begin = static_cast<int>(colours.size());
    if (island.contacts <= kOneChunk) {
      one_chunk(island);
    } else {
      cluster(island);
      colour_chunks(island);
    }
    island.body_end = static_cast<int>(body.size());
    island.chunk_end = static_cast<int>(chunks.size()) - 1;
    island.colour_end = static_cast<int>(colours.size());
    colours.push_back(island.chunk_end);
  }
  count_coupled();
}

// Contacts of the one body and of the other, those between the two once.
void ContactGraph::count_coupled() {
  const std::vector<int>&first = *first_, &second = *second_;
  const auto contacts = [&](int b) { return adjacent_start_[at(b) + 1] - adjacent_start_[at(b)]; };
  between_.assign(slot.size(), 0);
  count_.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) count_[i] = static_cast<float>(contacts(first[i]));
  for (int b : body) {
    const int* begin = adjacent_.data() + adjacent_start_[at(b)];
    const int* end = adjacent_.data() + adjacent_start_[at(b) + 1];
    const auto other = [&](int c) { return first[at(c)] == b ? second[at(c)] : first[at(c)]; };
    for (const int* c = begin; c < end; ++c)
      if (other(*c) >= 0) ++between_[at(other(*c))];
    for (const int* c = begin; c < end; ++c) {
      if (first[at(*c)] != b || second[at(*c)] < 0) continue;
      count_[at(*c)] += static_cast<float>(contacts(second[at(*c)]) - between_[at(second[at(*c)])]);
    }
    for (const int* c = begin; c < end; ++c)
      if (other(*c) >= 0) between_[at(other(*c))] = 0;
  }
  coupled.resize(order.size());
  for (std::size_t place = 0; place < order.size(); ++place)
    coupled[place] = count_[at(order[place])];
}

void ContactGraph::find_islands(int bodies) {
  const std::vector<int>&first = *first_, &second = *second_;
  const std::size_t n = first.size();
  parent_.resize(at(bodies));
  for (int b = 0; b < bodies; ++b) parent_[at(b)] = b;
  for (std::size_t i = 0; i < n; ++i) {
    if (second[i] < 0) continue;
    const int a = root(first[i]), b = root(second[i]);
    // The smaller index wins: the result depends on nothing else.
    (a < b ? parent_[at(b)] : parent_[at(a)]) = std::min(a, b);
  }
  island_of_.assign(at(bodies), -1);
  order.resize(n);  // here: contact -> island
  islands.clear();
  for (std::size_t i = 0; i < n; ++i) {
    int& island = island_of_[at(root(first[i]))];
    if (island < 0) {
      island = static_cast<int>(islands.size());
      islands.push_back({});
    }
    ++islands[at(island)].contacts;
    order[i] = island;
  }
  int begin = 0;
  for (Island& island : islands) {
    island.contact_begin = begin;
    begin += island.contacts;
  }
  sorted_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    sorted_[at(islands[at(order[i])].contact_begin++)] = static_cast<int>(i);
  }
  for (Island& island : islands) island.contact_begin -= island.contacts;
}

void ContactGraph::one_chunk(Island& island) {
  int* contacts = sorted_.data() + island.contact_begin;
  for (int k = 0; k < island.contacts; ++k) {
    for (int b : {(*first_)[at(contacts[k])], (*second_)[at(contacts[k])]}) {
      if (b < 0 || slot[at(b)] >= 0) continue;
      slot[at(b)] = static_cast<int>(body.size());
      body.push_back(b);
    }
  }
  colours.push_back(island.chunk_begin);
  order_within(contacts, contacts + island.contacts, island.contact_begin);
}

// Breadth-first balls: a cluster grows from its seed until it has enough contacts; bodies that it
// leaves at its rim become seeds. A contact belongs to the first cluster that reaches it.
void ContactGraph::cluster(Island& island) {
  const std::vector<int>&first = *first_, &second = *second_;
  const int size = std::max(kLeast, std::min(kMost, island.contacts / 128));
  int* contacts = sorted_.data() + island.contact_begin;
  for (int k = 0; k < island.contacts; ++k) taken_[at(contacts[k])] = 0;
  chunk_start_.clear();
  far_.clear();
  far_.push_back(first[at(contacts[0])]);
  int taken = 0;  // contacts are written back in the order of the clusters
  for (std::size_t seed = 0; seed < far_.size(); ++seed) {
    if (slot[at(far_[seed])] >= 0) continue;
    const int chunk = static_cast<int>(chunk_start_.size()), start = taken;
    near_.clear();
    near_.push_back(far_[seed]);
    mark_[at(far_[seed])] = chunk + island.chunk_begin;
    std::size_t next = 0;
    while (next < near_.size() && taken - start < size) {
      const int b = near_[next++];
      slot[at(b)] = static_cast<int>(body.size());
      body.push_back(b);
      for (int k = adjacent_start_[at(b)]; k < adjacent_start_[at(b + 1)]; ++k) {
        const int c = adjacent_[at(k)];
        if (!taken_[at(c)]) {
          taken_[at(c)] = 1;
          contacts[taken++] = c;
        }
        const int other = first[at(c)] == b ? second[at(c)] : first[at(c)];
        if (other < 0 || slot[at(other)] >= 0 || mark_[at(other)] == chunk + island.chunk_begin)
          continue;
        mark_[at(other)] = chunk + island.chunk_begin;
        near_.push_back(other);
      }
    }
    far_.insert(far_.end(), near_.begin() + static_cast<std::ptrdiff_t>(next), near_.end());
    if (taken > start) chunk_start_.push_back(start);
  }
  chunk_start_.push_back(taken);
}

// Greedy: of the colours that none of the chunk's bodies has, the one with the fewest contacts, so
// that no colour is too small to be shared among threads.
void ContactGraph::colour_chunks(Island& island) {
  const int n = static_cast<int>(chunk_start_.size()) - 1;
  const int* contacts = sorted_.data() + island.contact_begin;
  chunk_colour_.resize(at(n));
  int extra = kMasked, used_colours = 0, load[kMasked] = {};
  for (int c = 0; c < n; ++c) {
    std::uint64_t taken = 0;
    const auto over_bodies = [&](auto&& f) {
      for (int k = chunk_start_[at(c)]; k < chunk_start_[at(c + 1)]; ++k) {
        f(used_[at((*first_)[at(contacts[k])])]);
        const int b = (*second_)[at(contacts[k])];
        if (b >= 0) f(used_[at(b)]);
      }
    };
    over_bodies([&](std::uint64_t& used) { taken |= used; });
    int colour = -1;
    for (int k = 0; k < used_colours; ++k) {
      if (!(taken >> k & 1) && (colour < 0 || load[k] < load[colour])) colour = k;
    }
    if (colour < 0) colour = used_colours < kMasked ? used_colours++ : extra++;
    chunk_colour_[at(c)] = colour;
    if (colour >= kMasked) continue;
    load[colour] += chunk_start_[at(c + 1)] - chunk_start_[at(c)];
    over_bodies([&](std::uint64_t& used) { used |= std::uint64_t{1} << colour; });
  }
  // Colour by colour, chunks in their order.
  by_colour_.resize(at(extra + 1));
  std::fill(by_colour_.begin(), by_colour_.end(), 0);
  for (int c = 0; c < n; ++c) ++by_colour_[at(chunk_colour_[at(c)] + 1)];
  for (int colour = 0; colour < extra; ++colour)
    by_colour_[at(colour + 1)] += by_colour_[at(colour)];
  sequence_.resize(at(n));
  for (int c = 0; c < n; ++c) sequence_[at(by_colour_[at(chunk_colour_[at(c)])]++)] = c;
  int place = island.contact_begin, colour = -1;
  for (int c : sequence_) {
    if (chunk_colour_[at(c)] != colour) {
      colour = chunk_colour_[at(c)];
      colours.push_back(static_cast<int>(chunks.size()) - 1);
    }
    order_within(contacts + chunk_start_[at(c)], contacts + chunk_start_[at(c + 1)], place);
    place += chunk_start_[at(c + 1)] - chunk_start_[at(c)];
  }
}

// Every contact joins the first open group of its kind that none of its bodies is in.
void ContactGraph::order_within(const int* begin, const int* end, int place) {
  Chunk next = chunks.back();
  next.place = place + static_cast<int>(end - begin);
  for (std::vector<int>& list : by_kind_) list.clear();
  const auto kind_of = [&](int c) { return static_cast<int>((*kind_)[at(c)]); };
  if (!in_fours_ || end - begin < 4) {
    for (const int* c = begin; c < end; ++c) by_kind_[kind_of(*c)].push_back(*c);
  } else {
    group(begin, end);
  }
  for (int k = 0; k < kKinds; ++k) {
    for (int c : by_kind_[k]) order[at(place++)] = c;
    next.begin[k] += static_cast<int>(by_kind_[k].size());
  }
  chunks.push_back(next);
}

void ContactGraph::group(const int* begin, const int* end) {
  constexpr int kOpen = 16;  // groups of each kind that wait for members
  const std::vector<int>&first = *first_, &second = *second_;
  int members[2][kOpen][4], size[2][kOpen] = {};
  for (const int* c = begin; c < end; ++c) {
    used_[at(first[at(*c)])] = 0;
    if (second[at(*c)] >= 0) used_[at(second[at(*c)])] = 0;
  }
  const auto mark = [&](int c, std::uint64_t bit, bool in) {
    for (int b : {first[at(c)], second[at(c)]}) {
      if (b < 0) continue;
      std::uint64_t& used = used_[at(b)];
      used = in ? used | bit : used & ~bit;
    }
  };
  for (const int* p = begin; p < end; ++p) {
    const int c = *p;
    const Kind kind = (*kind_)[at(c)];
    std::vector<int>& single = by_kind_[static_cast<int>(kind)];
    if (kind == Kind::smooth) {
      single.push_back(c);
      continue;
    }
    const int type = kind == Kind::sphere ? 1 : 0, shift = type * kOpen;
    std::uint64_t taken = used_[at(first[at(c)])];
    if (second[at(c)] >= 0) taken |= used_[at(second[at(c)])];
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
    std::vector<int>& full = by_kind_[static_cast<int>(type ? Kind::sphere4 : Kind::general4)];
    for (int m : members[type][g]) {
      full.push_back(m);
      mark(m, bit, false);
    }
    size[type][g] = 0;
  }
  for (int type = 0; type < 2; ++type) {
    std::vector<int>& single = by_kind_[static_cast<int>(type ? Kind::sphere : Kind::general)];
    for (int g = 0; g < kOpen; ++g) {
      for (int m = 0; m < size[type][g]; ++m) single.push_back(members[type][g][m]);
    }
  }
}

std::size_t ContactGraph::contact_bytes() const {
  return sizeof(int) * (order.capacity() + sorted_.capacity() + adjacent_.capacity()) +
         sizeof(float) * (coupled.capacity() + count_.capacity()) + taken_.capacity() +
         sizeof(Chunk) * chunks.capacity() + sizeof(Island) * islands.capacity();
}

std::size_t ContactGraph::body_bytes() const {
  return sizeof(int) * (slot.capacity() + body.capacity() + parent_.capacity() +
                        island_of_.capacity() + adjacent_start_.capacity() + between_.capacity() +
                        mark_.capacity() + near_.capacity() + far_.capacity()) +
         sizeof(std::uint64_t) * used_.capacity();
}

}  // namespace tether::contact::detail
