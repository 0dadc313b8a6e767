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

int RankPlan::count(int chunk) const {
  return whole.chunks[at(chunk + 1)].place - whole.chunks[at(chunk)].place;
}

// visit(body) for each contact's bodies of a chunk: several times for a body.
template <class Visit>
void RankPlan::for_bodies(int chunk, const Visit& visit) const {
  for (int p = whole.chunks[at(chunk)].place; p < whole.chunks[at(chunk + 1)].place; ++p) {
    const int contact = whole.order[at(p)];
    visit(pairs_.one(contact));
    if (pairs_.other(contact) >= 0) visit(pairs_.other(contact));
  }
}

void RankPlan::build(const std::vector<int>& first, const std::vector<int>& second,
                     const std::vector<Kind>& kinds, const std::vector<int>& owner, int ranks_,
                     int rank_) {
  ranks = ranks_;
  rank = rank_;
  pairs_ = {&first, &second};
  whole.build(static_cast<int>(owner.size()), first, second, kinds, groups_are_served());
  assign(owner);
  select();
  home = owner;
  after.assign(part.colours.size(), {});
  share.assign(whole.islands.size(), {});
  last_rank_.assign(owner.size(), -1);
  last_colour_.assign(owner.size(), -1);
  for (int k = 0; k < static_cast<int>(whole.islands.size()); ++k) exchanges(k);
}

// Contacts of the places begin .. end by the rank that owns them.
std::vector<int> RankPlan::owned(int begin, int end, const std::vector<int>& owner) const {
  std::vector<int> out(at(ranks), 0);
  for (int place = begin; place < end; ++place) {
    const int c = whole.order[at(place)], one = pairs_.one(c), other = pairs_.other(c);
    ++out[at(owner[at(other >= 0 ? std::min(one, other) : one)])];
  }
  return out;
}

void RankPlan::assign(const std::vector<int>& owner) {
  chunk_rank.assign(whole.chunks.size(), 0);
  contact_rank.assign(at(pairs_.size()), 0);
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
    // A colour is balanced when no rank has more than 1.02 of its share, or when no chunk can move.
    const int from = most(load);
    const int to = static_cast<int>(std::min_element(load.begin(), load.end()) - load.begin());
    if (load[at(from)] * static_cast<double>(ranks) <= 1.02 * sum) return;
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

void RankPlan::take_chunk(int c) {
  const Chunk &one = whole.chunks[at(c)], &behind = whole.chunks[at(c + 1)];
  chunk_of.push_back(c);
  for (int place = one.place; place < behind.place; ++place) {
    part.order.push_back(whole.order[at(place)]);
    part.coupled.push_back(whole.coupled[at(place)]);
  }
  for_bodies(c, [&](int b) { part.slot[at(b)] = 0; });  // numbered when all chunks are known
  Chunk next = part.chunks.back();
  next.place += behind.place - one.place;
  for (int k = 0; k < kKinds; ++k) next.begin[k] += behind.begin[k] - one.begin[k];
  part.chunks.push_back(next);
}

// The chunks of this rank as a graph of their own; islands keep their numbers and their count of
// contacts.
void RankPlan::select() {
  for (std::vector<int>* list : {&part.order, &part.body, &part.colours, &chunk_of}) list->clear();
  part.coupled.clear();
  part.chunks.assign(1, {});
  part.islands = whole.islands;
  part.slot.assign(whole.slot.size(), -1);
  shared.clear();
  here.clear();
  for (std::size_t k = 0; k < whole.islands.size(); ++k) {
    const Island& all = whole.islands[k];
    Island& mine = part.islands[k];
    bool one = true;
    for (int c = all.chunk_begin; c < all.chunk_end; ++c)
      one = one && chunk_rank[at(c)] == chunk_rank[at(all.chunk_begin)];
    mine.contact_begin = static_cast<int>(part.order.size());
    mine.body_begin = static_cast<int>(part.body.size());
    mine.chunk_begin = static_cast<int>(part.chunks.size()) - 1;
    mine.colour_begin = static_cast<int>(part.colours.size());
    for (int colour = all.colour_begin; colour < all.colour_end; ++colour) {
      part.colours.push_back(static_cast<int>(part.chunks.size()) - 1);
      for (int c = whole.colours[at(colour)]; c < whole.colours[at(colour + 1)]; ++c)
        if (chunk_rank[at(c)] == rank) take_chunk(c);
    }
    mine.chunk_end = static_cast<int>(part.chunks.size()) - 1;
    mine.colour_end = static_cast<int>(part.colours.size());
    part.colours.push_back(mine.chunk_end);
    for (int s = all.body_begin; s < all.body_end; ++s) {
      const int body = whole.body[at(s)];
      if (part.slot[at(body)] < 0) continue;
      part.slot[at(body)] = static_cast<int>(part.body.size());
      part.body.push_back(body);
    }
    mine.body_end = static_cast<int>(part.body.size());
    shared.push_back(!one);
    here.push_back(mine.chunk_begin < mine.chunk_end);
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
    if (from == rank) lists[at(last_colour_[at(b)])].send(to, part.slot[at(b)]);
    if (to == rank) lists[at(last_colour_[at(b)])].receive(from, part.slot[at(b)]);
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
    if (home[at(b)] == rank) to_all.send(to, part.slot[at(b)]);
    if (to == rank) to_all.receive(home[at(b)], part.slot[at(b)]);
  }
  share[at(k)] = to_all.lists();
}

}  // namespace tether::contact::detail
