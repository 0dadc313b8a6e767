// Tether: sweeps of the contacts that have not settled. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/partial_sweeps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {
namespace {

constexpr int kFirst = 20, kLeastBetween = 5, kMostBetween = 320;  // sweeps

// The velocity that belongs to a change, relative to the scale of the contact's island.
double error(const System& system, int i, const double* weighted) {
  const double square =
      weighted[0] * weighted[0] + weighted[1] * weighted[1] + weighted[2] * weighted[2];
  return system.weight(i) * system.inverse_scale(i) * std::sqrt(square);
}

}  // namespace

void PartialSweeps::reset(int contacts) {
  n_ = contacts;
  listed_.assign(at(n_), 0);
  before_.resize(at(n_));
  start();
}

void PartialSweeps::start() {
  next_ = kFirst;
  between_ = kLeastBetween;
  least_ = std::numeric_limits<double>::infinity();
}

// Returns the largest error.
double PartialSweeps::find_unsettled(const Search& search, const Packed& change) {
  constexpr double kShare = 0.05;  // of the largest error
  double most = 0;
  for (int i = 0; i < n_; ++i) most = std::max(most, error(search.system, i, change[at(i)].v));
  const double least = 0.3 * search.options.tolerance;
  const double cut = std::max(kShare * most, least);
  to_tolerance_ = !(cut > least);
  unsettled_.clear();
  for (int i = 0; i < n_; ++i)
    if (error(search.system, i, change[at(i)].v) > cut) unsettled_.push_back(i);
  cut_ = cut;
  return most;
}

// The unsettled contacts and their neighbours, in ascending order.
void PartialSweeps::list_neighbours(const Problem& p) {
  list_.clear();
  for (int i : unsettled_)
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      if (listed_[at(j)]) continue;
      listed_[at(j)] = 1;
      list_.push_back(j);
    }
  for (int i : list_) listed_[at(i)] = 0;
  std::sort(list_.begin(), list_.end());
}

// False: the budget is spent, or they have become too many.
bool PartialSweeps::settle(Search& search, Packed& x) {
  constexpr double kMany = 0.3;      // of the contacts
  constexpr double kBudget = 0.1;    // of the work so far
  constexpr double kListCost = 1.3;  // of a contact in a full sweep
  System& system = search.system;
  const double end = (1 + kBudget) * search.counts.work;
  while (!unsettled_.empty()) {
    list_neighbours(system.problem());
    const double swept = static_cast<double>(list_.size());
    if (swept > kMany * n_ || search.counts.work > end || search.exhausted()) return false;
    for (int i : list_) before_[at(i)] = x[at(i)];
    system.sweep(x.data(), list_);
    search.counts.work += kListCost * search.sweep_cost * swept / n_;
    unsettled_.clear();
    for (int i : list_) {
      double change[3];
      for (int c = 0; c < 3; ++c)
        change[c] = system.weight(i) * (x[at(i)].v[c] - before_[at(i)].v[c]);
      if (error(system, i, change) > cut_) unsettled_.push_back(i);
    }
  }
  return true;
}

PartialSweeps::Outcome PartialSweeps::run(Search& search, int sweep, Packed& x,
                                          const Packed& change) {
  constexpr double kFew = 0.1;  // of the contacts
  constexpr double kGain = 0.5;
  if (!due(sweep)) return Outcome::none;
  next_ = sweep + kLeastBetween;
  const double most = find_unsettled(search, change);
  if (unsettled_.empty() || static_cast<double>(unsettled_.size()) > kFew * n_)
    return Outcome::none;
  const bool gained = settle(search, x) && most < kGain * least_;
  least_ = std::min(least_, most);
  between_ = gained ? kLeastBetween : std::min(kMostBetween, 2 * between_);
  next_ = sweep + between_;
  return gained ? Outcome::gained : Outcome::restless;
}

}  // namespace tether::contact::detail
