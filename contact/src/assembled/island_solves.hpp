// Tether: the islands of a problem, one by one. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/automatic.hpp"

namespace tether::contact::detail {

// Islands do not feel each other, but stages that take them together do: interior points have one
// step length and one factorisation for all, round-off that explains the error of one is that of
// the impulses of another, and sweeps go on everywhere until the last one ends. So each island is a
// problem of its own.
class IslandSolves {
 public:
  // Whether there is anything to take apart, by a measure that is one of islands. One island that
  // holds nearly all contacts is the problem: taken out, its sweeps would only begin anew.
  static bool serve(const Search& search);
  // From search.best; `stages` take all together what is solved one by one and not beside others.
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
