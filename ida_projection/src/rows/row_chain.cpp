// Tether: unknowns that rows would determine as they do forces. SPDX-License-Identifier:
// BSD-3-Clause
#include "rows/row_chain.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

namespace tether::ida_projection {

namespace {

using linalg::at;

constexpr std::size_t kAsked = 8;  // rows, of each kind

class Chains {
 public:
  explicit Chains(const RowPattern& rows)
      : rows_(rows), m_(static_cast<int>(rows.starts.size()) - 1), owners_(at(rows.n), -1) {
    with_first_.resize(at(rows.n));
    for (int i = 0; i < m_; ++i)
      if (size(i) > 0) with_first_[at(*begin(i))].push_back(i);
  }

  int count() const { return m_; }
  int size(int i) const { return rows_.starts[at(i + 1)] - rows_.starts[at(i)]; }
  const int* begin(int i) const { return rows_.columns.data() + rows_.starts[at(i)]; }
  const int* end(int i) const { return begin(i) + size(i); }
  template <class Holds>
  bool any_of(int i, Holds holds) const {
    return std::any_of(begin(i), end(i), holds);
  }
  /// f(k) for the shorter rows k whose columns all are some of row i.
  template <class Visit>
  void visit_contained(int i, Visit f) {
    for (const int* j = begin(i); j != end(i); ++j) owners_[at(*j)] = i;
    for (const int* j = begin(i); j != end(i); ++j)
      for (const int k : with_first_[at(*j)])
        if (size(k) < size(i) && !any_of(k, [&](int column) { return owners_[at(column)] != i; }))
          f(k);
  }

 private:
  const RowPattern& rows_;
  int m_;
  std::vector<int> owners_;
  std::vector<std::vector<int>> with_first_;  // rows by their first column
};

std::vector<int> marked(const std::vector<char>& marks) {
  std::vector<int> list;
  for (std::size_t j = 0; j < marks.size(); ++j)
    if (marks[j] != 0) list.push_back(static_cast<int>(j));
  return list;
}

// Some of the rows, the longest, as of energies, first and the shortest last.
std::vector<int> some(std::vector<int> rows, const Chains& of) {
  std::stable_sort(rows.begin(), rows.end(), [&](int i, int k) { return of.size(i) > of.size(k); });
  if (rows.size() <= kAsked) return rows;
  std::vector<int> chosen;
  for (std::size_t k = 0; k < kAsked; ++k)
    chosen.push_back(rows[k * (rows.size() - 1) / (kAsked - 1)]);
  return chosen;
}

template <class Own>
std::vector<std::vector<int>> columns_of(const std::vector<int>& rows, const Chains& of, Own own) {
  std::vector<std::vector<int>> groups;
  for (const int i : rows) {
    groups.emplace_back();
    std::copy_if(of.begin(i), of.end(i), std::back_inserter(groups.back()), own);
  }
  return groups;
}

}  // namespace

bool find_chain(const RowPattern& rows, const std::vector<int>& levels, int first,
                RowChain* chain) {
  Chains all(rows);
  const auto is_force = [&](int j) { return levels[at(j)] >= first; };
  std::vector<int> with_forces;
  for (int i = 0; i < all.count(); ++i)
    if (all.any_of(i, is_force)) with_forces.push_back(i);
  const auto forces =
      std::count_if(levels.begin(), levels.end(), [first](int level) { return level >= first; });
  if (with_forces.empty() || static_cast<std::ptrdiff_t>(with_forces.size()) != forces)
    return false;

  // The rows of velocities: of those without forces in each row with forces the one of the highest
  // level. Its unknowns of that level are the velocities.
  std::vector<int> highest(at(all.count()), -1);
  for (int i = 0; i < all.count(); ++i)
    std::for_each(all.begin(i), all.end(i),
                  [&](int j) { highest[at(i)] = std::max(highest[at(i)], levels[at(j)]); });
  std::vector<char> rate_row(at(all.count()), 0), velocity(at(rows.n), 0), position(velocity);
  for (const int i : with_forces) {
    int found = -1;
    all.visit_contained(i, [&](int k) {
      if (highest[at(k)] < first && (found < 0 || highest[at(k)] > highest[at(found)])) found = k;
    });
    if (found < 0) return false;
    rate_row[at(found)] = 1;
  }
  const std::vector<int> rate_rows = marked(rate_row);
  for (const int i : rate_rows)
    std::for_each(all.begin(i), all.end(i),
                  [&](int j) { velocity[at(j)] |= levels[at(j)] == highest[at(i)]; });
  const auto is_velocity = [&](int j) { return velocity[at(j)] != 0; };
  for (const int i : rate_rows) {
    bool any = false;
    all.visit_contained(i, [&](int k) {
      if (all.any_of(k, is_velocity)) return;
      any = true;
      std::for_each(all.begin(k), all.end(k), [&](int j) { position[at(j)] = 1; });
    });
    if (!any) return false;
  }

  chain->velocities = marked(velocity);
  chain->positions = marked(position);
  chain->forces.clear();
  for (int j = 0; j < rows.n; ++j)
    if (is_force(j)) chain->forces.push_back(j);
  chain->forces_of_rows = columns_of(some(with_forces, all), all, is_force);
  chain->velocities_of_rows = columns_of(some(rate_rows, all), all, is_velocity);
  return true;
}

}  // namespace tether::ida_projection
