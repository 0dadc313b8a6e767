// Tether: the best point so far and the work spent on it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "assembled/search/system.hpp"

namespace tether::contact::detail {

// The kind of stage that has found a point. With large mass ratios sweeps do not reach round-off,
// so long sums are not spent on their points.
enum class By { sweeps, factors };

// Stages improve the same best point; none may overwrite it by a worse one (method, section 10).
// All decisions use residuals and operation counts, never the clock.
struct Search {
  System system;
  Options options;
  Counts counts;
  Packed best;
  double best_error = std::numeric_limits<double>::infinity();
  double work_end = 0;                   // of the present attempt
  double sweep_cost = 0, test_cost = 0;  // estimated ns

  void reset(const Problem& problem, const Options& o);
  // Measures x, keeps it if it is the best.
  double test(const PackedVector* x, By by);
  // Whether errors near the tolerance need long sums, because sums of doubles are only round-off.
  bool near_round_off() const { return hidden_ > options.tolerance; }
  // Whether round-off may explain the error of the best point, which is then found with long sums.
  bool explained_by_round_off();
  // Errors of all contacts, as velocities over the scales of their islands: the change by a block
  // solution, or near_round_off() the judged error by long sums. Returns the largest.
  double errors(const PackedVector* x, double* each);
  bool solved() const { return best_error <= options.tolerance; }
  // Whether it is solved without knowledge of the last slips, as evaluate() judges it.
  bool confirmed();
  bool exhausted() const {
    return counts.work > work_end ||
           (best_error <= options.enough && counts.work > 0.75 * options.max_work);
  }
  void count_sweep() {
    ++counts.sweeps;
    counts.work += sweep_cost;
  }

 private:
  double fixed_point_error(const PackedVector* x, By by);

  Packed scratch_;
  double hidden_ = 0;  // error that round-off of double sums may hide; 0: not near the tolerance
};

}  // namespace tether::contact::detail
