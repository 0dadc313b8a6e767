// Tether: the best point so far and the work spent on it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "assembled/search/system.hpp"

namespace tether::contact::detail {

// Who has found a point: sweeps do not solve down to round-off between light and heavy bodies.
enum class By { sweeps, factors };

// Stages improve the same best point; none may overwrite it by a worse one (method, section 3).
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
  // Whether errors near the tolerance are found with long sums, those of doubles being round-off.
  bool near_round_off() const { return hidden_ > options.tolerance; }
  // Whether round-off may be what is left of the best point, whose error is then found with long
  // sums.
  bool explained_by_round_off();
  // Errors of all contacts, as velocities over the scales of their islands: what a block solution
  // changes, or with long sums near_round_off() what is judged. Returns the largest.
  double errors(const PackedVector* x, double* each);
  bool solved() const { return best_error <= options.tolerance; }
  // Whether it is solved for one who does not know where slips were found last, as evaluate().
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
  double hidden_ = 0;  // errors that round-off of double sums may make; 0: not near the tolerance
};

}  // namespace tether::contact::detail
