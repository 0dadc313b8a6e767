// Tether: multipliers that F does not determine. SPDX-License-Identifier: BSD-3-Clause
#include "watch/dead_point.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>
#include <vector>

#include "constraints/evaluator.hpp"
#include "start/nearby_residuals.hpp"
#include "start/undetermined_columns.hpp"

namespace tether::ida_projection {

namespace {

constexpr std::size_t kMostVariables = 200, kMostRows = 400, kMostEntries = 1000000;
constexpr double kChange = 1e-3;   // of max(1, |y_j|)
constexpr std::size_t kNamed = 6;  // the others are counted

std::string list(const std::vector<std::string>& names) {
  std::ostringstream out;
  const std::size_t shown = std::min(names.size(), kNamed);
  for (std::size_t k = 0; k < shown; ++k)
    out << (k == 0 ? "" : k + 1 < names.size() ? ", " : " and ") << names[k];
  if (shown < names.size()) out << " and " << names.size() - shown << " more";
  return out.str();
}

std::vector<std::string> free_variables(const Candidate& candidate, N_Vector at,
                                        const AlgebraicVariables& variables, Corrector& corrector,
                                        Statistics& statistics) {
  const auto size = static_cast<std::size_t>(N_VGetLength(candidate.base));
  std::vector<std::size_t> algebraic;
  for (std::size_t j = 0; j < size; ++j)
    if (variables.mask()[j] == 0.0) algebraic.push_back(j);
  if (algebraic.size() > kMostVariables) return {};
  std::vector<double> change(size);
  for (std::size_t j = 0; j < size; ++j) {
    const double w = candidate.weight_entries[j];
    change[j] = std::max(w > 0.0 ? 1.0 / w : 0.0,
                         kChange * std::max(1.0, std::abs(N_VGetArrayPointer(at)[j])));
  }
  NearbyResiduals near(candidate, corrector, statistics, std::move(change), at);
  bool known = near.known();
  Eigen::MatrixXd slopes(size, algebraic.size());
  for (std::size_t k = 0; k < algebraic.size() && known; ++k)
    known = near.slope(static_cast<int>(algebraic[k]), NearbyResiduals::Of::values,
                       slopes.col(static_cast<Eigen::Index>(k)));
  std::vector<std::string> names;
  if (!known) return names;
  const std::vector<char> free = undetermined_columns(std::move(slopes), false);
  for (std::size_t k = 0; k < free.size(); ++k)
    if (free[k]) names.push_back("y[" + std::to_string(algebraic[k]) + "]");
  return names;
}

// Entries count in tolerances.
std::vector<std::string> dependent_rows(const Candidate& candidate, N_Vector at,
                                        const Constraints& constraints) {
  if (!has_values(constraints)) return {};
  Statistics ignored;
  Evaluator evaluator(constraints, ignored);
  const auto m = static_cast<std::size_t>(evaluator.rows());
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
  if (m > kMostRows || m * n > kMostEntries) return {};
  std::vector<double> C(m * n), WT(n, 1.0);
  std::vector<int> columns(n);
  for (std::size_t j = 0; j < n; ++j) {
    columns[j] = static_cast<int>(j);
    if (candidate.weight_entries[j] > 0.0) WT[j] = 1.0 / candidate.weight_entries[j];
  }
  if (evaluator.jacobian(candidate.t, N_VGetArrayPointer(at), static_cast<int>(n), WT.data(),
                         columns, C.data()) != Status::success)
    return {};
  Eigen::MatrixXd transposed = Eigen::Map<Eigen::MatrixXd>(C.data(), static_cast<Eigen::Index>(n),
                                                           static_cast<Eigen::Index>(m));
  transposed.array().colwise() *=
      Eigen::Map<Eigen::ArrayXd>(WT.data(), static_cast<Eigen::Index>(n));
  std::vector<std::string> names;
  const std::vector<char> found = undetermined_columns(std::move(transposed), false);
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i]) names.push_back(constraints.name(static_cast<int>(i)));
  return names;
}

}  // namespace

std::string undetermined_multipliers(const Candidate& candidate, N_Vector y,
                                     const AlgebraicVariables& variables, Corrector& corrector,
                                     const Constraints& constraints, Statistics& statistics) {
  if (candidate.base_entries == nullptr || !variables.any()) return {};
  const std::vector<std::string> free =
      free_variables(candidate, y, variables, corrector, statistics);
  if (free.empty()) return {};
  const std::vector<std::string> rows = dependent_rows(candidate, y, constraints);
  std::ostringstream out;
  out << "F does not determine the algebraic variables " << list(free)
      << ": its derivatives by them depend on each other";
  if (!rows.empty()) out << ", as do the rows " << list(rows);
  out << "; at a dead point of a mechanism start beside it, joints that are there twice leave out";
  return out.str();
}

}  // namespace tether::ida_projection
