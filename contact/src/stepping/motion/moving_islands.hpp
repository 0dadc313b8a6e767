// Tether: bodies that move and touch. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <numeric>
#include <tether/contact/stepping.hpp>
#include <utility>
#include <vector>

namespace tether::contact::detail {

/// Sets of moving bodies that contacts and links connect.
class MovingIslands {
 public:
  void set_links(std::vector<std::pair<int, int>> links) { links_ = std::move(links); }

  void join(const BodySet& bodies, const StepContacts& contacts) {
    parent_.resize(bodies.motion.size());
    std::iota(parent_.begin(), parent_.end(), 0);
    for (const auto& [first, second] : links_)
      parent_[static_cast<std::size_t>(root(first))] = root(second);
    for (const PointContact& c : contacts.points)
      if (moves(bodies, c.first) && moves(bodies, c.second))
        parent_[static_cast<std::size_t>(root(c.first))] = root(c.second);
  }
  int root(int body) {
    const auto up = [&](int i) -> int& { return parent_[static_cast<std::size_t>(i)]; };
    while (up(body) != body) body = up(body) = up(up(body));
    return body;
  }
  /// Island of a contact's bodies, one of which moves.
  int root(const BodySet& bodies, const PointContact& c) {
    return root(moves(bodies, c.first) ? c.first : c.second);
  }

 private:
  static bool moves(const BodySet& bodies, int body) {
    return bodies.mass[static_cast<std::size_t>(body)] > 0;
  }
  std::vector<int> parent_;
  std::vector<std::pair<int, int>> links_;
};

}  // namespace tether::contact::detail
