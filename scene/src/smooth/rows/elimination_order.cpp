// Tether: an order of elimination for the matrix of a smooth system. SPDX-License-Identifier:
// BSD-3-Clause
#include "elimination_order.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <limits>

#include "mechanics/index.hpp"

namespace tether::scene::smooth {

using mechanics::at;

namespace {

using Graph = Eigen::SparseMatrix<char, Eigen::ColMajor, int>;

/// Bodies of each multiplier: the two of its joint, -1 where there are fewer.
using Ends = std::vector<std::pair<int, int>>;

// When each body is eliminated.
std::vector<int> times_of_bodies(int bodies, std::vector<Eigen::Triplet<char>>& edges) {
  Graph graph(bodies, bodies);
  const auto once = [](char a, char) { return a; };
  graph.setFromTriplets(edges.begin(), edges.end(), once);
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(graph.selfadjointView<Eigen::Lower>(), order);
  std::vector<int> time(at(bodies));
  for (int k = 0; k < bodies; ++k) time[at(order.indices()[k])] = k;
  return time;
}

}  // namespace

std::vector<int> elimination_order(int unknowns, int bodies, int width, int coordinates,
                                   const std::vector<std::pair<int, int>>& places) {
  const int first = width * bodies;
  Ends ends(at(unknowns - first), {-1, -1});
  std::vector<Eigen::Triplet<char>> edges;
  const auto join = [&](int a, int b) {
    if (a != b) edges.emplace_back(std::max(a, b), std::min(a, b), char(1));
  };
  const auto touch = [&](int multiplier, int body) {
    auto& [a, b] = ends[at(multiplier - first)];
    if (a < 0) a = body;
    if (a != body && b < 0) b = body;
  };
  for (const auto& [row, column] : places) {
    if (row < first && column < first)
      join(row / width, column / width);
    else if (row < first)
      touch(column, row / width);
  }
  for (const auto& [a, b] : ends)
    if (a >= 0 && b >= 0) join(a, b);
  for (int body = 0; body < bodies; ++body) edges.emplace_back(body, body, char(1));
  const std::vector<int> time = times_of_bodies(bodies, edges);

  // Coordinates first; of each other unknown the time of its body; multipliers come behind the
  // later one's unknowns.
  std::vector<std::pair<int, int>> when(at(unknowns));
  for (int i = 0; i < unknowns; ++i) {
    int instant = std::numeric_limits<int>::max();
    if (i < first && i % width < coordinates) {
      instant = -1;
    } else if (i < first) {
      instant = time[at(i / width)];
    } else if (const auto [a, b] = ends[at(i - first)]; a >= 0) {
      instant = std::max(time[at(a)], b >= 0 ? time[at(b)] : 0);
    }
    when[at(i)] = {instant, i};
  }
  std::sort(when.begin(), when.end());
  std::vector<int> order(at(unknowns));
  std::transform(when.begin(), when.end(), order.begin(), [](const auto& w) { return w.second; });
  return order;
}

}  // namespace tether::scene::smooth
