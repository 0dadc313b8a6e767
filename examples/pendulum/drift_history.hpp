// Tether: how far a run leaves its invariants. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "experiment.hpp"

namespace pendulum {

/// Distances from the two invariants that a reader can picture.
struct Drift {
  double t = 0.0;       ///< s
  double length = 0.0;  ///< |sqrt(x^2 + y^2) - L|, m
  double energy = 0.0;  ///< |v^2/2 + g y|, J/kg; the start has 0
};

/// Largest drift in each of many windows of time, which are equally wide on a logarithmic axis.
class DriftHistory {
 public:
  explicit DriftHistory(const Experiment& experiment);

  void add(double t, const double* y);
  Drift largest() const;
  /// Windows in which there was a step; t is the last one of the window.
  std::vector<Drift> windows() const;

 private:
  double length_, gravity_, first_, duration_;
  std::vector<Drift> windows_;
};

}  // namespace pendulum
