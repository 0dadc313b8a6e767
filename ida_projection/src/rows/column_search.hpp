// Tether: which columns of an unknown sparse matrix are empty. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

namespace tether::ida_projection {

/// Finds the variables on which a function of n variables does not depend. Groups of variables are
/// changed together and halved if some row changes. Groups whose parents changed disjoint rows
/// share an evaluation. Variables that few rows share cost about 2 log2(n) probes altogether, n
/// variables that all rows share cost 2 n.
class ColumnSearch {
 public:
  /// Changes these variables at once and sets changed[i] to 1 for each row that changes; `changed`
  /// comes as zeros. False: the function cannot be evaluated there.
  using Probe = std::function<bool(const std::vector<int>& columns, std::vector<char>& changed)>;
  enum class Outcome { found, too_many_probes, refused };

  ColumnSearch(int columns, int rows, Probe probe, long most_probes)
      : n_(columns), m_(rows), probe_(std::move(probe)), left_(most_probes) {}

  /// `filled`: n entries, 1 if some row depends on the variable.
  Outcome run(std::vector<char>* filled) {
    filled->assign(at(n_), 0);
    groups_.clear();
    columns_.reserve(at(n_));
    if (n_ == 0) return Outcome::found;
    groups_.push_back({0, n_, std::vector<int>(at(m_))});
    std::iota(groups_[0].rows.begin(), groups_[0].rows.end(), 0);
    while (!groups_.empty()) {
      waiting_.resize(groups_.size());
      std::iota(waiting_.begin(), waiting_.end(), std::size_t{0});
      while (!waiting_.empty()) {
        take_set();
        const Outcome outcome = probe_together(set_);
        if (outcome != Outcome::found) return outcome;
      }
      std::vector<Group> halves;
      halves.reserve(2 * groups_.size());
      std::size_t rows_of_groups = 0;
      for (Group& group : groups_) {
        if (group.rows.empty()) continue;
        rows_of_groups += group.rows.size();
        if (rows_of_groups > kMostProbes) return Outcome::too_many_probes;
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

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static constexpr std::size_t kMostProbes = 20000000;  // rows of all groups: 80 MB

  struct Group {
    int begin, end;
    std::vector<int> rows;  // rows that may depend on it
  };
  // Moves waiting groups into set_, as long as each shares no row with those before it.
  void take_set() {
    set_.clear();
    rest_.clear();
    taken_.assign(at(m_), 0);
    for (const std::size_t k : waiting_) {
      const std::vector<int>& rows = groups_[k].rows;
      const auto is_taken = [this](int i) { return taken_[at(i)] != 0; };
      const bool joins = std::none_of(rows.begin(), rows.end(), is_taken);
      (joins ? set_ : rest_).push_back(k);
      for (std::size_t e = 0; joins && e < rows.size(); ++e) taken_[at(rows[e])] = 1;
    }
    waiting_.swap(rest_);
  }
  Outcome probe_together(const std::vector<std::size_t>& members) {
    if (members.size() == 1) return probe_alone(groups_[members[0]]);
    if (--left_ < 0) return Outcome::too_many_probes;
    columns_.clear();
    for (const std::size_t k : members) change(groups_[k]);
    changed_.assign(at(m_), 0);
    long known = 0;
    const bool evaluated = probe_(columns_, changed_);
    for (const std::size_t k : members) {
      if (!evaluated) break;
      const auto silent = [this](int i) { return changed_[at(i)] == 0; };
      std::vector<int>& rows = groups_[k].rows;
      rows.erase(std::remove_if(rows.begin(), rows.end(), silent), rows.end());
      known += static_cast<long>(rows.size());
    }
    if (evaluated && known == std::count(changed_.begin(), changed_.end(), 1))
      return Outcome::found;
    // The probe failed, or a row changed that no parent group had changed: groups are probed
    // singly.
    for (const std::size_t k : members) {
      const Outcome outcome = probe_alone(groups_[k]);
      if (outcome != Outcome::found) return outcome;
    }
    return Outcome::found;
  }
  Outcome probe_alone(Group& group) {
    if (--left_ < 0) return Outcome::too_many_probes;
    columns_.clear();
    change(group);
    changed_.assign(at(m_), 0);
    const bool evaluated = probe_(columns_, changed_);
    if (!evaluated) return group.end - group.begin > 1 ? Outcome::found : Outcome::refused;
    group.rows.clear();
    for (int i = 0; i < m_; ++i)
      if (changed_[at(i)]) group.rows.push_back(i);
    return Outcome::found;
  }
  void change(const Group& group) {
    for (int j = group.begin; j < group.end; ++j) columns_.push_back(j);
  }

  int n_, m_;
  Probe probe_;
  long left_;
  std::vector<Group> groups_;
  std::vector<std::size_t> waiting_, set_, rest_;  // groups not yet probed; those of one probe
  std::vector<int> columns_;
  std::vector<char> changed_, taken_;
};

}  // namespace tether::ida_projection
