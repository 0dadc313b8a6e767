// Tether: islands of moving bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <utility>
#include <vector>

namespace tether::contact::detail {

/// Sets of moving bodies that contacts and links connect.
class MovingIslands {
 public:
  /// `links` connect bodies, as contacts do.
  explicit MovingIslands(const std::vector<std::pair<int, int>>& links = {}) : links_(links) {}

  void join(const BodySet& bodies, const StepContacts& contacts) {
    sets_.reset(bodies.size());
    for (const auto& [first, second] : links_) sets_.join(first, second);
    for (const PointContact& c : contacts.points)
      if (moves(bodies, c.first) && moves(bodies, c.second)) sets_.join(c.first, c.second);
  }
  /// After join(): marks the roots of these bodies.
  void mark(const std::vector<int>& bodies, std::vector<char>& marks, char mark = 1) {
    for (const int i : bodies) marks[static_cast<std::size_t>(root(i))] = mark;
  }
  int root(int body) { return sets_.root(body); }
  /// Island of a contact's bodies, one of which moves.
  int root(const BodySet& bodies, const PointContact& c) {
    return root(moves(bodies, c.first) ? c.first : c.second);
  }

 private:
  static bool moves(const BodySet& bodies, int body) {
    return bodies.mass[static_cast<std::size_t>(body)] > 0;
  }
  linalg::DisjointSets sets_;
  std::vector<std::pair<int, int>> links_;
};

}  // namespace tether::contact::detail
