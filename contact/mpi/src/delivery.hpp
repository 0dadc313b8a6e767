// Tether: bodies and contacts to where they are swept, and results back. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "whole_problem.hpp"

namespace tether::contact_mpi::detail {

/// Items by number that one rank has and another one needs; both know which, in ascending order.
class Delivery {
 public:
  Delivery(Messages& messages, std::size_t numbers) : messages_(messages), numbers_(numbers) {}
  void add(int item, int from, int to) {
    if (from == messages_.rank()) to_[to].push_back(item);
    if (to == messages_.rank()) from_[from].push_back(item);
  }
  /// write(item, numbers) for those sent, read(item, numbers) for those received.
  template <class Write, class Read>
  void run(const Write& write, const Read& read);

 private:
  Messages& messages_;
  std::size_t numbers_;  // of an item
  std::map<int, std::vector<int>> to_, from_;
};

template <class Write, class Read>
void Delivery::run(const Write& write, const Read& read) {
  std::map<int, contact::RankMessages::With> of;
  for (const auto& [rank, items] : to_) {
    of[rank].out.resize(numbers_ * items.size());
    double* out = of[rank].out.data();
    for (int item : items) write(item, out), out += numbers_;
  }
  for (const auto& [rank, items] : from_) of[rank].in.resize(numbers_ * items.size());
  std::vector<contact::RankMessages::With> with;
  for (auto& [rank, w] : of) {
    w.rank = rank;
    if (rank == messages_.rank()) w.in = w.out;
    if (rank != messages_.rank()) with.push_back(std::move(w));
  }
  messages_.exchange(with);
  for (auto& w : with) of[w.rank] = std::move(w);
  for (const auto& [rank, items] : from_) {
    const double* in = of[rank].in.data();
    for (int item : items) read(item, in), in += numbers_;
  }
}

}  // namespace tether::contact_mpi::detail
