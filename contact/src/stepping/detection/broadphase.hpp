// Tether: which balls are near each other. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace tether::contact::detail {

/// Finds overlapping pairs among the bounding spheres of shapes by a sorted uniform grid. Cells are
/// as wide as the largest sphere of common size. The few that are much larger are compared with all
/// others.
class Broadphase {
 public:
  /// Visits each pair of balls that overlap once, in an order that depends on positions only.
  /// `still` marks balls of bodies that do not move: two of them are no pair.
  template <class Visit>
  void pairs(const std::vector<Eigen::Vector3d>& centre, const std::vector<double>& radius,
             const std::vector<char>& still, const Visit& visit) {
    build(centre, radius);
    const auto meet = [&](int a, int b) {
      const double sum = radius[static_cast<std::size_t>(a)] + radius[static_cast<std::size_t>(b)];
      if ((centre[static_cast<std::size_t>(a)] - centre[static_cast<std::size_t>(b)])
                  .squaredNorm() < sum * sum &&
          !(still[static_cast<std::size_t>(a)] && still[static_cast<std::size_t>(b)]))
        a < b ? visit(a, b) : visit(b, a);
    };
    for (std::size_t k = 0; k < large_.size(); ++k) {
      for (std::size_t l = k + 1; l < large_.size(); ++l) meet(large_[k], large_[l]);
      for (const Cell& c : cells_) meet(large_[k], c.ball);
    }
    // Each pair of neighbouring cells is visited once: the following cells of the same column, and
    // three cells in each of four neighbouring columns. Keys ascend, so that the window in each of
    // these columns only moves forward.
    constexpr std::uint64_t kX = std::uint64_t{1} << 42, kY = std::uint64_t{1} << 21;
    const std::uint64_t column[4] = {kY, kX - kY, kX, kX + kY};
    std::size_t window[4] = {0, 0, 0, 0};
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const std::uint64_t key = cells_[i].key;
      for (std::size_t j = i + 1; j < cells_.size() && cells_[j].key <= key + 1; ++j)
        meet(cells_[i].ball, cells_[j].ball);
      for (int c = 0; c < 4; ++c) {
        std::size_t& w = window[c];
        while (w < cells_.size() && cells_[w].key < key + column[c] - 1) ++w;
        for (std::size_t j = w; j < cells_.size() && cells_[j].key <= key + column[c] + 1; ++j)
          meet(cells_[i].ball, cells_[j].ball);
      }
    }
  }

 private:
  struct Cell {
    std::uint64_t key;  // x, y, z of the cell, 21 bits each, x first
    int ball;
  };
  void build(const std::vector<Eigen::Vector3d>& centre, const std::vector<double>& radius);

  std::vector<Cell> cells_;
  std::vector<int> large_;
  std::vector<double> sorted_;
};

inline void Broadphase::build(const std::vector<Eigen::Vector3d>& centre,
                              const std::vector<double>& radius) {
  cells_.clear();
  large_.clear();
  if (radius.empty()) return;

  // Balls larger than four times the median are few; in the grid they would widen all cells.
  sorted_ = radius;
  const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  const double most = 4 * *middle;
  double widest = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  for (std::size_t k = 0; k < radius.size(); ++k) {
    if (radius[k] > most) continue;
    widest = std::max(widest, radius[k]);
    low = low.cwiseMin(centre[k]);
    high = high.cwiseMax(centre[k]);
  }
  // At most 1e6 cells in a direction, so that a coordinate has 20 bits: cells grow where a body has
  // flown far away.
  const double extent = (high - low).maxCoeff();
  const double cell = std::max(2 * widest, extent / 1e6);
  const double inverse = cell > 0 ? 1 / cell : 0;
  for (std::size_t k = 0; k < radius.size(); ++k) {
    if (radius[k] > most) {
      large_.push_back(static_cast<int>(k));
      continue;
    }
    std::uint64_t key = 0;
    // Coordinates begin at 1, so that every cell has a predecessor.
    for (int d = 0; d < 3; ++d)
      key = (key << 21) + static_cast<std::uint64_t>((centre[k][d] - low[d]) * inverse) + 1;
    cells_.push_back({key, static_cast<int>(k)});
  }
  std::sort(cells_.begin(), cells_.end(), [](const Cell& a, const Cell& b) {
    return a.key != b.key ? a.key < b.key : a.ball < b.ball;
  });
}

}  // namespace tether::contact::detail
