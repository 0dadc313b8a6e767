// Tether: the islands of a problem, one by one. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/island_solves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {
namespace {

constexpr double kBlock = 20;  // ns that it takes to take a block out of the problem

}  // namespace

bool IslandSolves::serve(const Search& search) {
  constexpr double kNearlyAll = 0.9;
  if (search.options.measure != Measure::fixed_point || search.system.islands() < 2) return false;
  std::vector<int> size(at(search.system.islands()));
  for (int k : search.system.problem().islands()) ++size[at(k)];
  return *std::max_element(size.begin(), size.end()) <= kNearlyAll * search.system.size();
}

// Numbers of islands follow their first contacts.
void IslandSolves::find_islands(const Search& search) {
  const std::vector<int>& island = search.system.problem().islands();
  islands_.assign(at(search.system.islands()), {0, 0, Status::unsolved});
  for (int k : island) ++islands_[at(k)].size;
  int first = 0;
  for (Island& k : islands_) {
    k.first = first;
    first += k.size;
    k.size = 0;
  }
  contacts_.resize(island.size());
  for (std::size_t i = 0; i < island.size(); ++i) {
    Island& k = islands_[at(island[i])];
    contacts_[at(k.first + k.size++)] = static_cast<int>(i);
  }
}

void IslandSolves::solve(Search& search, Island& island, double budget) {
  const int* contacts = contacts_.data() + island.first;
  const Problem problem =
      search.system.problem().part(std::vector<int>(contacts, contacts + island.size));
  search.counts.work += kBlock * static_cast<double>(problem.blocks().size());
  Options options = search.options;
  options.max_work = budget;
  search_.reset(problem, options);
  search_.system.belong_to(search.system, contacts);
  search_.system.share_as(search.system, contacts);
  Packed start(at(island.size));
  for (int r = 0; r < island.size; ++r) start[at(r)] = x_[at(contacts[r])];
  search_.system.to_own_units(start.data());
  automatic_.reset(island.size, options);
  search_.test(start.data(), By::factors);
  island.status = search_.solved() ? Status::solved : automatic_.run(search_);
  search.counts.add(search_.counts);
  search_.system.to_given_units(search_.best.data());
  for (int r = 0; r < island.size; ++r) {
    x_[at(contacts[r])] = search_.best[at(r)];
    if (search_.system.replaced(r)) search.system.replace(contacts[r]);
  }
  if (island.status != Status::infeasible || !proof_.empty()) return;
  proof_.assign(x_.size(), PackedVector());
  for (int r = 0; r < island.size; ++r) proof_[at(contacts[r])] = automatic_.proof()[at(r)];
}

Status IslandSolves::run(Search& search, Automatic& stages) {
  find_islands(search);
  x_ = search.best;
  // Small islands first, each with an equal part of the work left: larger ones get what these save.
  std::vector<Island*> order;
  for (Island& island : islands_) order.push_back(&island);
  std::stable_sort(order.begin(), order.end(),
                   [](const Island* p, const Island* q) { return p->size < q->size; });
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double left = search.options.max_work - search.counts.work;
    if (left > 0)
      solve(search, *order[k], left / static_cast<double>(order.size() - k));
    else
      order[k]->status = Status::work_limit;
  }
  // Each island keeps its best point, also if another one is not solved.
  search.best_error = std::numeric_limits<double>::infinity();
  search.test(x_.data(), By::factors);
  if (search.solved()) return Status::solved;
  // The status that says most comes last in this list.
  Status out = Status::solved;
  for (Status s : {Status::unsolved, Status::stalled, Status::cycling, Status::round_off,
                   Status::work_limit, Status::infeasible})
    for (const Island& island : islands_)
      if (island.status == s) out = s;
  // Solved one by one, but not together: rounding of one island exceeds the tolerance of another.
  return out == Status::solved ? stages.run(search) : out;
}

}  // namespace tether::contact::detail
