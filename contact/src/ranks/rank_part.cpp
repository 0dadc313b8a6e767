// Tether: what a rank tells the others while they sweep islands together. SPDX-License-Identifier:
// BSD-3-Clause
#include "ranks/rank_part.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::contact::detail {

using linalg::at;

RankPart::With RankPart::buffers(const RankExchanges& exchanges) {
  With out;
  for (const RankExchange& e : exchanges)
    out.push_back({e.rank, std::vector<double>(6 * e.send.size()),
                   std::vector<double>(6 * e.receive.size())});
  return out;
}

void RankPart::start(RankMessages& messages) {
  messages_ = &messages;
  after_.clear();
  share_.clear();
  for (const RankExchanges& e : plan_.after) after_.push_back(buffers(e));
  for (const RankExchanges& e : plan_.share) share_.push_back(buffers(e));
}

void RankPart::pass_on(const RankExchanges& exchanges, With& with, MovingBodies& bodies) {
  if (with.empty()) return;
  for (std::size_t k = 0; k < with.size(); ++k) {
    double* out = with[k].out.data();
    for (int slot : exchanges[k].send) bodies.get(slot, out), out += 6;
  }
  messages_->exchange(with);
  for (std::size_t k = 0; k < with.size(); ++k) {
    const double* in = with[k].in.data();
    for (int slot : exchanges[k].receive) bodies.set(slot, in), in += 6;
  }
}

void RankPart::after_colour(int colour, MovingBodies& bodies) {
  pass_on(plan_.after[at(colour)], after_[at(colour)], bodies);
}

void RankPart::share(MovingBodies& bodies) {
  pass_on(plan_.share[at(island_)], share_[at(island_)], bodies);
}

// In the order of the chunks of the whole, as one process adds them.
PassResult RankPart::total(const std::vector<PassResult>& sums) {
  const Island &all = plan_.whole.islands[at(island_)], &mine = plan_.part.islands[at(island_)];
  sums_.assign(4 * at(all.chunk_end - all.chunk_begin), 0);
  for (int c = mine.chunk_begin; c < mine.chunk_end; ++c) {
    double* four = sums_.data() + 4 * at(plan_.chunk_of[at(c)] - all.chunk_begin);
    four[0] = sums[at(c)].sum;
    four[1] = sums[at(c)].most;
    four[2] = sums[at(c)].speed;
    four[3] = sums[at(c)].started;
  }
  messages_->sum(sums_);
  PassResult total;
  for (std::size_t c = 0; c < sums_.size(); c += 4) {
    PassResult r;
    r.sum = sums_[c];
    r.most = sums_[c + 1];
    r.speed = sums_[c + 2];
    r.started = sums_[c + 3];
    total.add(r);
  }
  return total;
}

}  // namespace tether::contact::detail
