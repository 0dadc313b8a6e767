// Tether: rows that have a kink on their set. SPDX-License-Identifier: BSD-3-Clause
#include "watch/kink.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "constraints/evaluator.hpp"

namespace tether::ida_projection {

const char* const kKink =
    "; its slopes to both sides differ there: a row with |.| or max has no derivative on the set, "
    "write it without";

bool has_kink(const Constraints& constraints, int row, int column, double given, double t,
              std::vector<double> y) {
  constexpr double kReach = 1e-4, kDiffer = 0.1;
  Statistics ignored;
  Evaluator evaluator(constraints, ignored);
  const auto n = static_cast<int>(y.size());
  const auto j = static_cast<std::size_t>(column);
  const double here = y[j], reach = kReach * std::max(1.0, std::abs(here));
  std::vector<double> g(static_cast<std::size_t>(evaluator.rows()));
  double at[3];
  for (int k = 0; k < 3; ++k) {
    y[j] = here + (k - 1) * reach;
    if (evaluator.value(t, y.data(), n, g.data()) != Status::success) return false;
    at[k] = g[static_cast<std::size_t>(row)];
  }
  const double left = (at[1] - at[0]) / reach, right = (at[2] - at[1]) / reach;
  const double size = kDiffer * std::max(std::abs(left), std::abs(right));
  return std::abs(left - right) > size &&
         std::min(std::abs(given - left), std::abs(given - right)) <= size;
}

}  // namespace tether::ida_projection
