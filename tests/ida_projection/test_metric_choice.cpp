// Tether: levels of columns, and when another metric is tried. SPDX-License-Identifier:
// BSD-3-Clause
#include "rows/row_levels.hpp"
#include "step/metric_choice.hpp"
#include "support/catch.hpp"

using namespace tether::ida_projection;

namespace {

using Rows = std::vector<std::vector<int>>;

std::vector<int> levels(const Rows& rows, int n) {
  std::vector<int> starts = {0}, columns;
  for (const std::vector<int>& row : rows) {
    columns.insert(columns.end(), row.begin(), row.end());
    starts.push_back(static_cast<int>(columns.size()));
  }
  return levels_of_columns(starts, columns, n);
}

}  // namespace

TEST_CASE("levels: positions, velocities and accelerations of a chain, whatever stands between") {
  // Of points 0 .. 3: q = 3 i, v = 3 i + 1, a = 3 i + 2; rods between neighbours, and an energy.
  Rows rows;
  for (int level = 2; level >= 0; --level)  // the longest first
    for (int i = 0; i < 3; ++i) {
      std::vector<int> row;
      for (int point = i; point <= i + 1; ++point)
        for (int k = 0; k <= level; ++k) row.push_back(3 * point + k);
      rows.push_back(row);
    }
  rows.push_back({0, 1, 3, 4, 6, 7, 9, 10});
  CHECK(levels(rows, 14) == std::vector<int>{0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, -1, -1});
}

TEST_CASE("levels: rows none of which holds another one have one level") {
  CHECK(levels({{0, 1}, {1, 2}, {2, 3}, {0, 1}}, 4) == std::vector<int>(4, 0));
  CHECK(levels({{}, {0, 2}}, 3) == std::vector<int>{0, -1, 0});
  CHECK(levels({}, 2) == std::vector<int>{-1, -1});
}

TEST_CASE("choice of the metric: looks at each of the first moves, then seldom") {
  MetricChoice choice;
  int looks = 0;
  for (int move = 0; move < 16 + 80; ++move)
    if (choice.due()) {
      ++looks;
      CHECK_FALSE(choice.doubts({0.1, 1e-3}));
    }
  CHECK(looks == 16 + 10);
}

TEST_CASE("choice of the metric: the other one is taken where it halves the move and its answer") {
  MetricChoice choice;
  const AnsweredMove stiff{0.1, 0.05};
  CHECK_FALSE(choice.doubts({1e-5, 9e-5}));  // harms nobody
  REQUIRE(choice.doubts(stiff));
  CHECK_FALSE(choice.prefers({0.08, 0.0}, stiff));
  CHECK_FALSE(choice.by_levels());
  CHECK_FALSE(choice.doubts(stiff));  // not at once again
  REQUIRE(choice.doubts(stiff));
  CHECK(choice.prefers({0.05, 0.01}, stiff));
  CHECK(choice.by_levels());
  REQUIRE(choice.due());
  REQUIRE(choice.doubts(stiff));
  CHECK(choice.prefers({0.01, 0.001}, stiff));
  CHECK_FALSE(choice.by_levels());
}
