// Tether: which rank sweeps which contacts, and who tells whom. SPDX-License-Identifier:
// BSD-3-Clause
#include "ranks/rank_plan.hpp"

#include <algorithm>
#include <map>
#include <tether/linalg/index.hpp>
#include <utility>

#include "body_passes/body_kernels.hpp"
#include "body_sweeps/implementation.hpp"

namespace tether::contact::detail {

using linalg::at;

namespace {

// A colour is balanced when no rank has more than this of its share, or when no chunk can move.
constexpr double kUneven = 1.02;

int most(const std::vector<int>& numbers) {
  return static_cast<int>(std::max_element(numbers.begin(), numbers.end()) - numbers.begin());
}

// Pairs (rank, slot) of what is sent and received as lists by rank.
class ExchangeLists {
 public:
  void send(int rank, int slot) { of_[rank].first.push_back(slot); }
  void receive(int rank, int slot) { of_[rank].second.push_back(slot); }
  RankExchanges lists() const {
    RankExchanges out;
    for (const auto& [rank, slots] : of_) out.push_back({rank, slots.first, slots.second});
    return out;
  }

 private:
  std::map<int, std::pair<std::vector<int>, std::vector<int>>> of_;
};

}  // namespace

void select_chunks(const ContactGraph& from, const std::vector<int>& first,
                   const std::vector<int>& second, const std::vector<char>& wanted,
                   const ChunkSelection& out) {
  ContactGraph& part = out.part;
  part.order.clear();
  part.coupled.clear();
  part.chunks.assign(1, {});
  part.colours.clear();
  part.islands.clear();
  out.contacts.clear();
  out.bodies.clear();
  out.chunks.clear();
  std::vector<char> seen(from.slot.size(), 0);
  const auto take = [&](int c) {
    const Chunk &one = from.chunks[at(c)], &behind = from.chunks[at(c + 1)];
    out.chunks.push_back(c);
    for (int place = one.place; place < behind.place; ++place) {
      const int contact = from.order[at(place)];
      part.order.push_back(static_cast<int>(out.contacts.size()));
      part.coupled.push_back(from.coupled[at(place)]);
      out.contacts.push_back(contact);
      for (int b : {first[at(contact)], second[at(contact)]})
        if (b >= 0) seen[at(b)] = 1;
    }
    Chunk next = part.chunks.back();
    next.place += behind.place - one.place;
    for (int k = 0; k < kKinds; ++k) next.begin[k] += behind.begin[k] - one.begin[k];
    part.chunks.push_back(next);
  };
  for (const Island& island : from.islands) {
    Island mine = island;
    mine.contact_begin = static_cast<int>(part.order.size());
    mine.body_begin = static_cast<int>(out.bodies.size());
    mine.chunk_begin = static_cast<int>(part.chunks.size()) - 1;
    mine.colour_begin = static_cast<int>(part.colours.size());
    for (int k = island.colour_begin; k < island.colour_end; ++k) {
      part.colours.push_back(static_cast<int>(part.chunks.size()) - 1);
      for (int c = from.colours[at(k)]; c < from.colours[at(k + 1)]; ++c)
        if (wanted[at(c)]) take(c);
    }
    mine.chunk_end = static_cast<int>(part.chunks.size()) - 1;
    mine.colour_end = static_cast<int>(part.colours.size());
    part.colours.push_back(mine.chunk_end);
    for (int s = island.body_begin; s < island.body_end; ++s)
      if (seen[at(from.body[at(s)])]) out.bodies.push_back(from.body[at(s)]);
    mine.body_end = static_cast<int>(out.bodies.size());
    part.islands.push_back(mine);
  }
  part.body.resize(out.bodies.size());
  for (std::size_t s = 0; s < part.body.size(); ++s) part.body[s] = static_cast<int>(s);
  part.slot = part.body;
}

int RankPlan::count(int chunk) const {
  return whole.chunks[at(chunk + 1)].place - whole.chunks[at(chunk)].place;
}

// visit(body) for each contact's bodies of a chunk: several times for a body.
template <class Visit>
void RankPlan::for_bodies(int chunk, const Visit& visit) const {
  for (int p = whole.chunks[at(chunk)].place; p < whole.chunks[at(chunk + 1)].place; ++p) {
    const std::size_t contact = at(whole.order[at(p)]);
    visit(first[contact]);
    if (second[contact] >= 0) visit(second[contact]);
  }
}

void RankPlan::build(const std::vector<RankContact>& links, const std::vector<int>& owner,
                     int ranks_, int rank_) {
  ranks = ranks_;
  rank = rank_;
  const int bodies_of_all = static_cast<int>(owner.size());
  std::vector<Kind> kinds;
  first.clear();
  second.clear();
  for (const RankContact& c : links) {
    first.push_back(c.first);
    second.push_back(c.second);
    kinds.push_back(static_cast<Kind>(c.kind));
  }
  whole.build(bodies_of_all, first, second, kinds, groups_are_served());
  assign(owner);
  select(links, bodies_of_all);
  home = owner;
  after.assign(part.colours.size(), {});
  share.assign(whole.islands.size(), {});
  last_rank_.assign(at(bodies_of_all), -1);
  last_colour_.assign(at(bodies_of_all), -1);
  for (int k = 0; k < static_cast<int>(whole.islands.size()); ++k) exchanges(k);
}

// Contacts of the places begin .. end by the rank that owns them.
std::vector<int> RankPlan::owned(int begin, int end, const std::vector<int>& owner) const {
  std::vector<int> out(at(ranks), 0);
  for (int place = begin; place < end; ++place) {
    const std::size_t c = at(whole.order[at(place)]);
    ++out[at(owner[at(second[c] >= 0 ? std::min(first[c], second[c]) : first[c])])];
  }
  return out;
}

void RankPlan::assign(const std::vector<int>& owner) {
  chunk_rank.assign(whole.chunks.size(), 0);
  contact_rank.assign(first.size(), 0);
  for (const Island& island : whole.islands) {
    const bool one = island.contacts < kTogether;
    const int all =
        one ? most(owned(island.contact_begin, island.contact_begin + island.contacts, owner)) : 0;
    for (int c = island.chunk_begin; c < island.chunk_end; ++c) {
      chunk_rank[at(c)] =
          one ? all : most(owned(whole.chunks[at(c)].place, whole.chunks[at(c + 1)].place, owner));
    }
    for (int k = island.colour_begin; k < island.colour_end && !one; ++k)
      balance(whole.colours[at(k)], whole.colours[at(k + 1)], owner);
    for (int c = island.chunk_begin; c < island.chunk_end; ++c)
      for (int p = whole.chunks[at(c)].place; p < whole.chunks[at(c + 1)].place; ++p)
        contact_rank[at(whole.order[at(p)])] = chunk_rank[at(c)];
  }
}

// Chunks of a colour from the rank that has the most to the one that has the least, those first of
// which that one owns more.
void RankPlan::balance(int begin, int end, const std::vector<int>& owner) {
  std::vector<int> load(at(ranks), 0);
  int sum = 0;
  for (int c = begin; c < end; ++c) {
    load[at(chunk_rank[at(c)])] += count(c);
    sum += count(c);
  }
  std::vector<std::vector<int>> of;  // of each chunk, when needed
  for (int moves = begin; moves < end; ++moves) {
    const int from = most(load);
    const int to = static_cast<int>(std::min_element(load.begin(), load.end()) - load.begin());
    if (load[at(from)] * static_cast<double>(ranks) <= kUneven * sum) return;
    if (of.empty()) {
      for (int c = begin; c < end; ++c)
        of.push_back(owned(whole.chunks[at(c)].place, whole.chunks[at(c + 1)].place, owner));
    }
    int best = -1, gain = 0;
    for (int c = begin; c < end; ++c) {
      // Less than the difference: the larger of both loads falls.
      if (chunk_rank[at(c)] != from || count(c) >= load[at(from)] - load[at(to)]) continue;
      const int g = of[at(c - begin)][at(to)] - of[at(c - begin)][at(from)];
      if (best < 0 || g > gain) best = c, gain = g;
    }
    if (best < 0) return;
    chunk_rank[at(best)] = to;
    load[at(from)] -= count(best);
    load[at(to)] += count(best);
  }
}

void RankPlan::select(const std::vector<RankContact>& links, int bodies_of_all) {
  std::vector<char> wanted(chunk_rank.size());
  for (std::size_t c = 0; c < wanted.size(); ++c) wanted[c] = chunk_rank[c] == rank;
  select_chunks(whole, first, second, wanted, {part, contacts, bodies, chunk_of});
  slot_.assign(at(bodies_of_all), -1);
  for (std::size_t s = 0; s < bodies.size(); ++s) slot_[at(bodies[s])] = static_cast<int>(s);
  for (int c : contacts) {
    const int b = links[at(c)].fixed;
    if (b < 0 || slot_[at(b)] >= 0) continue;
    slot_[at(b)] = static_cast<int>(bodies.size());
    bodies.push_back(b);
    part.slot.push_back(-1);
  }
  shared.clear();
  here.clear();
  for (std::size_t k = 0; k < whole.islands.size(); ++k) {
    const Island &all = whole.islands[k], &mine = part.islands[k];
    here.push_back(mine.chunk_begin < mine.chunk_end);
    bool one = true;
    for (int c = all.chunk_begin; c < all.chunk_end; ++c)
      one = one && chunk_rank[at(c)] == chunk_rank[at(all.chunk_begin)];
    shared.push_back(!one);
  }
}

// The same loop on all ranks, so that both sides of an exchange have its bodies in the same order.
void RankPlan::exchanges(int k) {
  const Island &all = whole.islands[at(k)], &mine = part.islands[at(k)];
  const int colours = all.colour_end - all.colour_begin;
  if (!shared[at(k)]) {
    for (int s = all.body_begin; s < all.body_end; ++s)
      home[at(whole.body[at(s)])] = chunk_rank[at(all.chunk_begin)];
    return;
  }
  std::vector<ExchangeLists> lists(at(colours));
  std::vector<std::pair<int, int>> others;  // body and a rank that is not its home
  const auto pass_on = [&](int b, int to) {
    const int from = last_rank_[at(b)];
    if (from == to) return;
    if (from == rank) lists[at(last_colour_[at(b)])].send(to, slot_[at(b)]);
    if (to == rank) lists[at(last_colour_[at(b)])].receive(from, slot_[at(b)]);
  };
  for (int colour = 0; colour < colours; ++colour) {
    const int end = whole.colours[at(all.colour_begin + colour + 1)];
    for (int c = whole.colours[at(all.colour_begin + colour)]; c < end; ++c) {
      const int by = chunk_rank[at(c)];
      for_bodies(c, [&](int b) {
        if (last_rank_[at(b)] < 0) {
          home[at(b)] = by;
        } else {
          pass_on(b, by);
          if (by != home[at(b)] && last_rank_[at(b)] != by) others.emplace_back(b, by);
        }
        last_rank_[at(b)] = by;
        last_colour_[at(b)] = colour;
      });
    }
  }
  for (int s = all.body_begin; s < all.body_end; ++s)
    pass_on(whole.body[at(s)], home[at(whole.body[at(s)])]);
  for (int colour = 0; colour < colours; ++colour)
    after[at(mine.colour_begin + colour)] = lists[at(colour)].lists();
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());
  ExchangeLists to_all;
  for (const auto& [b, to] : others) {
    if (home[at(b)] == rank) to_all.send(to, slot_[at(b)]);
    if (to == rank) to_all.receive(home[at(b)], slot_[at(b)]);
  }
  share[at(k)] = to_all.lists();
}

}  // namespace tether::contact::detail
