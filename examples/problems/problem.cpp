// Tether: a DAE test problem with its invariants and reference. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <problems/problem.hpp>
#include <stdexcept>

namespace tether::problems {

ida_projection::Constraints Problem::select(const std::vector<std::string>& names) const {
  ida_projection::Constraints joined;
  bool first = true;
  for (const std::string& wanted : names) {
    const auto found = std::find_if(rows.begin(), rows.end(),
                                    [&](const Rows& group) { return group.name == wanted; });
    if (found == rows.end()) {
      std::string message = name + ", " + form + ": no rows \"" + wanted + "\"; there are";
      for (const Rows& group : rows) message += " \"" + group.name + "\"";
      throw std::invalid_argument(message);
    }
    joined = first ? found->constraints : std::move(joined) + found->constraints;
    first = false;
  }
  return joined;
}

ida_projection::Constraints Problem::recommended_constraints() const {
  return sparse_constraints ? *sparse_constraints : select(recommended);
}

double Problem::error(const double* y) const {
  double worst = 0.0;
  int compared = 0;
  for (int i = 0; i < error_components; ++i) {
    const double expected = reference[static_cast<std::size_t>(i)];
    if (std::isnan(expected)) continue;
    ++compared;
    const double relative = std::abs(y[i] - expected) / (1.0 + std::abs(expected));
    if (!std::isfinite(relative)) return std::numeric_limits<double>::quiet_NaN();
    worst = std::max(worst, relative);
  }
  const bool known = compared > 0 || error_components == 0;
  return known ? worst : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace tether::problems
