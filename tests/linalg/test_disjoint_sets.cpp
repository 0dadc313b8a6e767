// Tether: disjoint sets. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <random>
#include <tether/linalg/disjoint_sets.hpp>
#include <vector>

#include "support/catch.hpp"

using tether::linalg::DisjointSets;

TEST_CASE("disjoint sets: the least index is the root, in whatever order sets are joined") {
  constexpr int kSize = 60;
  std::mt19937 random(2);
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i + 3 < kSize; ++i)
    if (i % 7 != 0) pairs.emplace_back(i + 3, i);
  std::vector<int> expected;
  for (int order = 0; order < 20; ++order) {
    DisjointSets sets(kSize);
    std::shuffle(pairs.begin(), pairs.end(), random);
    for (const auto& [i, j] : pairs) order % 2 == 0 ? sets.join(i, j) : sets.join(j, i);
    std::vector<int> roots;
    for (int i = 0; i < kSize; ++i) roots.push_back(sets.root(i));
    for (int i = 0; i < kSize; ++i) CHECK(roots[static_cast<std::size_t>(i)] <= i);
    if (order == 0) expected = roots;
    CHECK(roots == expected);
  }
}

TEST_CASE("disjoint sets: joining tells whether sets were apart; reset() makes them so again") {
  DisjointSets sets(3);
  CHECK(sets.join(0, 2));
  CHECK_FALSE(sets.join(2, 0));
  CHECK_FALSE(sets.join(1, 1));
  sets.reset(4);
  CHECK(sets.root(2) == 2);
  CHECK(sets.root(3) == 3);
}
