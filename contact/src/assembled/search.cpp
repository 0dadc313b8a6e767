// Tether: the best point so far and the work spent on it. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/search.hpp"

#include <algorithm>

namespace tether::contact::detail {

void Search::reset(const Problem& problem, const Options& o, Measure m) {
  options = o;
  measure = m;
  system.reset(problem, o.law);
  counts = Counts();
  work_end = o.max_work;
  history.clear();
  best_error = std::numeric_limits<double>::infinity();
  const std::size_t n = at(problem.contacts());
  best.resize(n);
  scratch_.resize(n);
  sweep_cost = 2.2 * static_cast<double>(problem.blocks().size()) + 30.0 * problem.contacts();
  test_cost = m == Measure::fixed_point ? 1.2 * sweep_cost : 0.8 * sweep_cost;
}

double Search::test(const PackedVector* x, Method stage) {
  ++counts.tests;
  counts.work += test_cost;
  const Test t = measure == Measure::fixed_point ? system.fixed_point(x)
                                                 : system.natural_map(x, scratch_.data());
  double error = system.measure(t, measure);
  // Impulses that swallow b leave a small residual by round-off.
  if (error <= options.tolerance) error = std::max(error, system.rounding(x));
  if (error < best_error) {
    best_error = error;
    std::copy(x, x + best.size(), best.begin());
  }
  if (options.history) {
    const int iteration = stage == Method::admm ? counts.admm_iterations
                          : stage == Method::proximal_newton || stage == Method::interior_point
                              ? counts.factorisations
                              : counts.sweeps;
    history.push_back({stage, iteration, best_error});
  }
  return error;
}

}  // namespace tether::contact::detail
