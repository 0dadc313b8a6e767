// Tether: multipliers that F does not determine. SPDX-License-Identifier: BSD-3-Clause
#include "watch/dead_point.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "host/shortest.hpp"
#include "start/nearby_residuals.hpp"
#include "start/undetermined_columns.hpp"

namespace tether::ida_projection {

namespace {

constexpr std::size_t kMostVariables = 200;
constexpr double kChange = 1e-3;  // of max(1, |y_j|)

}  // namespace

std::string undetermined_multipliers(const Candidate& candidate, N_Vector y,
                                     const AlgebraicVariables& variables, Corrector& corrector,
                                     RowFaults& faults, Statistics& statistics) {
  if (candidate.base_entries == nullptr || !variables.any()) return {};
  const double* const entries = N_VGetArrayPointer(y);
  const std::vector<double> at(entries, entries + N_VGetLength(y));
  std::vector<double> change(at.size()), WT(at.size(), 1.0);
  std::vector<int> algebraic;
  for (std::size_t j = 0; j < at.size(); ++j) {
    const double w = candidate.weight_entries[j];
    if (w > 0.0) WT[j] = 1.0 / w;
    change[j] = std::max(w > 0.0 ? WT[j] : 0.0, kChange * std::max(1.0, std::abs(at[j])));
    if (variables.mask()[j] == 0.0) algebraic.push_back(static_cast<int>(j));
  }
  if (algebraic.size() > kMostVariables) return {};
  NearbyResiduals near(candidate, corrector, statistics, std::move(change), y);
  Eigen::MatrixXd slopes(at.size(), algebraic.size());
  for (std::size_t k = 0; k < algebraic.size(); ++k)
    if (!near.slope(algebraic[k], NearbyResiduals::Of::values,
                    slopes.col(static_cast<Eigen::Index>(k))))
      return {};
  const std::vector<char> found = undetermined_columns(std::move(slopes), false);
  std::vector<int> free;
  for (std::size_t k = 0; k < found.size(); ++k)
    if (found[k]) free.push_back(algebraic[k]);
  if (free.empty()) return {};
  const std::vector<std::string> rows = faults.dependent(candidate.t, at, WT);
  return "F does not determine the algebraic variables " + listed(free) +
         ": its derivatives by them depend on each other" +
         (rows.empty() ? "" : ", as do the rows " + listed(rows)) +
         "; start beside a singular position of a mechanism, and leave out joints that are given "
         "twice";
}

}  // namespace tether::ida_projection
