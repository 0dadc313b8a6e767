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

namespace {

constexpr double kReach = 1e-4, kDiffer = 0.1;  // of y; of the slopes
constexpr double kWrong = 1e-3;                 // of the row's largest entry

}  // namespace

bool has_kink(const Constraints& constraints, int row, int column, double given, double t,
              std::vector<double> y) {
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

std::string wrong_entry(const Constraints& constraints, double t, const std::vector<double>& y) {
  try {
    const JacobianReport report = check_jacobian(constraints, t, y, kWrong);
    if (report.correct) return {};
    const bool kink = has_kink(constraints, report.row, report.column, report.given, t, y);
    return report.message + (kink ? kKink : "");
  } catch (const std::exception&) {  // g refuses a point nearby: nothing is known
    return {};
  }
}

bool has_kink(const Constraints& constraints, int row, double t, std::vector<double> y) {
  Statistics ignored;
  Evaluator evaluator(constraints, ignored);
  std::vector<double> g(static_cast<std::size_t>(evaluator.rows()));
  const auto at = [&](double* value) {
    const bool known =
        evaluator.value(t, y.data(), static_cast<int>(y.size()), g.data()) == Status::success;
    *value = g[static_cast<std::size_t>(row)];
    return known;
  };
  double here = 0.0, plus = 0.0, minus = 0.0, largest = 0.0, bend = 0.0;
  if (!at(&here)) return false;
  for (double& unknown : y) {
    const double present = unknown, reach = kReach * std::max(1.0, std::abs(present));
    unknown = present + reach;
    bool known = at(&plus);
    unknown = present - reach;
    known = at(&minus) && known;
    unknown = present;
    if (!known) return false;
    largest = std::max({largest, std::abs(plus - here), std::abs(here - minus)});
    bend = std::max(bend, std::abs(plus - 2.0 * here + minus));
  }
  return bend > kDiffer * largest;
}

std::vector<int> one_sided(const Constraints& constraints, const std::vector<int>& rows, double t,
                           const std::vector<double>& y) {
  Statistics ignored;
  Evaluator evaluator(constraints, ignored);
  const auto m = static_cast<std::size_t>(evaluator.rows());
  std::vector<double> moved(y), here(m), plus(m), minus(m);
  const auto g_at = [&](double share, double turn, std::vector<double>& g) {
    for (std::size_t j = 0; j < y.size(); ++j)
      moved[j] = y[j] + share * kReach * std::max(1.0, std::abs(y[j])) *
                            std::sin(1.0 + turn * static_cast<double>(j));
    return evaluator.value(t, moved.data(), static_cast<int>(y.size()), g.data()) ==
           Status::success;
  };
  if (!g_at(0.0, 0.0, here)) return {};
  std::vector<int> found;
  for (const double turn : {3.7, 1.3}) {
    if (!g_at(1.0, turn, plus) || !g_at(-1.0, turn, minus)) return {};
    for (const int row : rows) {
      const auto i = static_cast<std::size_t>(row);
      const double ahead = std::abs(plus[i] - here[i]), behind = std::abs(minus[i] - here[i]);
      if (std::min(ahead, behind) <= kDiffer * std::max(ahead, behind) &&
          std::max(ahead, behind) > 0.0 &&
          std::find(found.begin(), found.end(), row) == found.end())
        found.push_back(row);
    }
  }
  return found;
}

}  // namespace tether::ida_projection
