// Tether: the islands of a problem, one by one. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/automatic.hpp"

namespace tether::contact::detail {

// Islands are independent, but stages that solve them together couple them. Interior points have
// one step length for all; the round-off of large impulses in one island hides the error of
// another; sweeps go on in all until the slowest has ended. So each island is solved as a problem.
class IslandSolves {
 public:
  // Whether a solve by islands is worth while: the measure is one of islands, and no island holds
  // nearly all contacts (its sweeps would only begin again).
  static bool serve(const Search& search);
  // Solves from search.best. If each island is solved by itself but their union is not, `stages` go
  // on with all of them together.
  Status run(Search& search, Automatic& stages);
  // The normal impulses that prove infeasibility; empty: none are known.
  const Packed& proof() const { return proof_; }
  void reset() { proof_.clear(); }

 private:
  struct Island {
    int first, size;  // in contacts_
    Status status;
  };
  void find_islands(const Search& search);
  void solve(Search& search, Island& island, double budget);

  std::vector<Island> islands_;
  std::vector<int> contacts_;  // island by island
  Packed x_, proof_;
  Search search_;
  Automatic automatic_;
};

}  // namespace tether::contact::detail
