// Tether: which directions of C can be trusted. SPDX-License-Identifier: BSD-3-Clause
#include "rows/row_trust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::ida_projection {

namespace {

constexpr double kSafety = 2.0;
constexpr long kLearnEvery = 64;

}  // namespace

int RowTrust::trusted_rows(const Solver& solver, double length) const {
  if (kappa_ < 0.0) return rows_from(solver, length > kShort ? kThin : 0.0);
  return rows_from(solver, std::min(kThin, kSafety * kappa_ * length));
}

bool RowTrust::wants_to_learn(double length) {
  if (!(length > kShort)) return false;
  return kappa_ < 0.0 || length > 4.0 * measured_ || ++candidates_ % kLearnEvery == 0;
}

void RowTrust::learn(Solver& solver, const std::vector<int>& rows, const std::vector<int>& columns,
                     int n, const std::vector<double>& before, const std::vector<double>& after,
                     double length) {
  const double* D = solver.metric();
  double largest = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double norm = solver.row_norm(static_cast<int>(i));
    if (!(norm > std::numeric_limits<double>::min())) continue;
    const auto first = static_cast<std::size_t>(rows[i]) * static_cast<std::size_t>(n);
    double sum = 0.0;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const std::size_t entry = first + static_cast<std::size_t>(columns[k]);
      const double change = (after[entry] - before[entry]) * D[k];
      sum += change * change;
    }
    largest = std::max(largest, std::sqrt(sum) / norm);
  }
  if (!std::isfinite(largest)) return;
  kappa_ = std::max(kappa_, largest / length);
  measured_ = std::max(measured_, length);
}

}  // namespace tether::ida_projection
