// Tether: a point far from the constraints onto them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "row_blocks.hpp"

namespace tether::ida_projection {

/// Damped Gauss-Newton in the error weights, min |WT^-1 dy| subject to C dy = g, with the natural
/// monotonicity test: a step s dy is taken when the simplified next correction C^+ g(y - s dy) is
/// at most (1 - s/2) |dy| long; otherwise s is halved (Deuflhard, Newton Methods for Nonlinear
/// Problems, section 3.3). Contiguous vectors.
class GaussNewton {
 public:
  GaussNewton(const Constraints& constraints, int size);

  /// Moves y (N entries) at time t. WT: error weights, all > 0. `id` as in RowBlocks. Fills the
  /// report's status, message, iterations, drift, rank and rows; y changes only on success.
  void project(double t, std::vector<double>& y, const std::vector<double>& WT,
               const std::vector<bool>& hold, const double* id, ConsistencyReport& report);

  /// After project(): y' onto C y' + g_t = 0 (nearest in the weights), with g_t by central
  /// differences. False if g fails nearby.
  bool tangent(double t, const std::vector<double>& y, double* yp);

 private:
  bool evaluate(double t, const std::vector<double>& y, ConsistencyReport& report);
  double correction();  // solves for the present g, returns its length
  double largest(const std::vector<double>& g) const;

  const Constraints& constraints_;
  Statistics counts_;
  Evaluator evaluator_;
  RowBlocks blocks_;
  int n_, m_;
  std::vector<double> WT_, g_, C_;
  double rank_tolerance_;
};

}  // namespace tether::ida_projection
