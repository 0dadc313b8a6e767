// Tether: which balls are near each other. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/broadphase.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {

void Broadphase::build(const std::vector<Eigen::Vector3d>& centre,
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
