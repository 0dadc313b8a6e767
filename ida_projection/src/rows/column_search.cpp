// Tether: which columns of an unknown sparse matrix are empty. SPDX-License-Identifier:
// BSD-3-Clause
#include "rows/column_search.hpp"

#include <algorithm>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::ida_projection {

namespace {

constexpr std::size_t kMostAnswers = 20000000;  // rows of all groups: 80 MB

using linalg::at;

}  // namespace

// Sets of groups without a common row, each group in the first set that takes it.
std::vector<std::vector<std::size_t>> ColumnSearch::separate() const {
  std::vector<std::vector<std::size_t>> sets, sets_of_row(at(m_));
  std::vector<std::size_t> taken;  // by set: the last group that cannot join it
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    for (const int i : groups_[k].rows)
      for (const std::size_t set : sets_of_row[at(i)]) taken[set] = k + 1;
    std::size_t set = 0;
    while (set < sets.size() && taken[set] == k + 1) ++set;
    if (set == sets.size()) {
      // More sets than probes: the search is about to end, whatever else is found out.
      if (static_cast<long>(sets.size()) > left_) return sets;
      sets.emplace_back();
      taken.push_back(0);
    }
    sets[set].push_back(k);
    for (const int i : groups_[k].rows) sets_of_row[at(i)].push_back(set);
  }
  return sets;
}

void ColumnSearch::change(const Group& group) {
  for (int j = group.begin; j < group.end; ++j) columns_.push_back(j);
}

ColumnSearch::Outcome ColumnSearch::probe_alone(Group& group) {
  if (--left_ < 0) return Outcome::too_many_probes;
  columns_.clear();
  change(group);
  changed_.assign(at(m_), 0);
  const bool answered = probe_(columns_, changed_);
  if (!answered) return group.end - group.begin > 1 ? Outcome::found : Outcome::refused;
  group.rows.clear();
  for (int i = 0; i < m_; ++i)
    if (changed_[at(i)]) group.rows.push_back(i);
  return Outcome::found;
}

ColumnSearch::Outcome ColumnSearch::probe_together(const std::vector<std::size_t>& members) {
  if (members.size() == 1) return probe_alone(groups_[members[0]]);
  if (--left_ < 0) return Outcome::too_many_probes;
  columns_.clear();
  for (const std::size_t k : members) change(groups_[k]);
  changed_.assign(at(m_), 0);
  long known = 0;
  const bool answered = probe_(columns_, changed_);
  for (const std::size_t k : members) {
    if (!answered) break;
    const auto silent = [this](int i) { return changed_[at(i)] == 0; };
    std::vector<int>& rows = groups_[k].rows;
    rows.erase(std::remove_if(rows.begin(), rows.end(), silent), rows.end());
    known += static_cast<long>(rows.size());
  }
  if (answered && known == std::count(changed_.begin(), changed_.end(), 1)) return Outcome::found;
  // The probe failed, or a row answered that no parent knew: one by one.
  for (const std::size_t k : members) {
    const Outcome outcome = probe_alone(groups_[k]);
    if (outcome != Outcome::found) return outcome;
  }
  return Outcome::found;
}

ColumnSearch::Outcome ColumnSearch::run(std::vector<char>* filled) {
  filled->assign(at(n_), 0);
  groups_.clear();
  if (n_ == 0) return Outcome::found;
  groups_.push_back({0, n_, std::vector<int>(at(m_))});
  std::iota(groups_[0].rows.begin(), groups_[0].rows.end(), 0);
  while (!groups_.empty()) {
    for (const auto& set : separate()) {
      const Outcome outcome = probe_together(set);
      if (outcome != Outcome::found) return outcome;
    }
    std::vector<Group> halves;
    std::size_t answers = 0;
    for (Group& group : groups_) {
      if (group.rows.empty()) continue;
      answers += group.rows.size();
      if (answers > kMostAnswers) return Outcome::too_many_probes;
      if (group.end - group.begin == 1) {
        (*filled)[at(group.begin)] = 1;
        continue;
      }
      const int middle = group.begin + (group.end - group.begin) / 2;
      halves.push_back({group.begin, middle, group.rows});
      halves.push_back({middle, group.end, std::move(group.rows)});
    }
    groups_ = std::move(halves);
  }
  return Outcome::found;
}

}  // namespace tether::ida_projection
