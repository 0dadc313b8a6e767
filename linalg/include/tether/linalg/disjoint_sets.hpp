// Tether: disjoint sets of indices. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <vector>

namespace tether::linalg {

/// Partition of 0 .. n - 1 by union-find with path halving (Tarjan and van Leeuwen, J. ACM 31,
/// 1984, 245). The least index of a set is its root, so that the result does not depend on the
/// order in which sets are joined.
class DisjointSets {
 public:
  /// n sets of one index each.
  explicit DisjointSets(int n = 0) { reset(n); }

  /// Each of n indices is a set of its own. Allocates only where n grows.
  void reset(int n) {
    parent_.resize(at(n));
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  /// The least index of the set of i; O(log n) amortised.
  int root(int i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  /// Unites the sets of i and j. False: they are one already.
  bool join(int i, int j) {
    const int a = root(i), b = root(j);
    parent_[at(std::max(a, b))] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<int> parent_;
};

}  // namespace tether::linalg
