// Tether: the best point so far and the work spent on it. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/search/search.hpp"

#include <algorithm>

namespace tether::contact::detail {
namespace {

constexpr double kExactCost = 5;  // tests

}  // namespace

void Search::reset(const Problem& problem, const Options& o) {
  options = o;
  system.reset(problem, o.law);
  counts = Counts();
  work_end = o.max_work;
  best_error = std::numeric_limits<double>::infinity();
  hidden_ = 0;
  const std::size_t n = at(problem.contacts());
  best.resize(n);
  scratch_.resize(n);
  sweep_cost = 2.2 * static_cast<double>(problem.blocks().size()) + 30.0 * problem.contacts();
  test_cost = o.measure == Measure::fixed_point ? 1.2 * sweep_cost : 0.8 * sweep_cost;
}

// The error, at least the round-off of A x - b: impulses that swallow b leave a small residual by
// chance. Long sums are taken where the rounding of doubles may decide; sweeps take them last.
double Search::fixed_point_error(const PackedVector* x, By by) {
  constexpr double kNear = 1e3;  // tolerances
  const double tolerance = options.tolerance;
  const Test test = system.fixed_point(x);
  // The block fixed point leads the search, also where it has jumped away: `least` ends it.
  const double fast = test.least <= tolerance ? test.least : test.fixed;
  double rounding = 0;
  if (fast <= tolerance || (by == By::factors && fast <= kNear * tolerance)) {
    rounding = system.rounding(x);
    hidden_ = kSumUnits * rounding;
  }
  if (fast > std::max(tolerance, hidden_)) return fast;
  if (hidden_ <= tolerance) return std::max(fast, rounding);
  counts.work += kExactCost * test_cost;
  if (!(rounding > 0)) rounding = system.rounding(x);
  return std::max(system.exact_fixed_point(x), rounding);
}

double Search::errors(const PackedVector* x, double* each) {
  if (near_round_off()) {
    counts.work += kExactCost * test_cost;
    return system.exact_fixed_point(x, each);
  }
  counts.work += sweep_cost;
  system.changes(x, scratch_.data(), each);
  return *std::max_element(each, each + system.size());
}

bool Search::confirmed() {
  if (!solved()) return false;
  system.forget_slips();
  const Packed found = best;
  best_error = std::numeric_limits<double>::infinity();
  test(found.data(), By::factors);
  return solved();
}

bool Search::explained_by_round_off() {
  const double rounding = system.rounding(best.data());
  hidden_ = kSumUnits * rounding;
  // Impulses that grow without an end swallow b: what they leave of it is no round-off.
  if (!(best_error <= hidden_) || best_error >= 1) return false;
  if (options.measure == Measure::fixed_point) {
    counts.work += kExactCost * test_cost;
    best_error = std::min(best_error, std::max(system.exact_fixed_point(best.data()), rounding));
  }
  return true;
}

double Search::test(const PackedVector* x, By by) {
  counts.work += test_cost;
  double error;
  if (options.measure == Measure::fixed_point) {
    error = fixed_point_error(x, by);
  } else {
    error = system.natural_map(x, scratch_.data());
    // Impulses that swallow b leave a small residual by round-off.
    if (error <= options.tolerance) error = std::max(error, system.rounding(x));
  }
  if (error < best_error) {
    best_error = error;
    std::copy(x, x + best.size(), best.begin());
  }
  return error;
}

}  // namespace tether::contact::detail
