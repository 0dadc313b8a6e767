// Tether: a point far from the constraints onto them (method, section 11). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "movers/mover.hpp"

namespace tether::ida_projection {

/// Damped Gauss-Newton in the error weights, min |WT^-1 dy| subject to C dy = g, with the natural
/// monotonicity test: a step s dy is taken when the simplified next correction C^+ g(y - s dy) is
/// at most (1 - s/2) |dy| long; otherwise s is halved (Deuflhard, Newton Methods for Nonlinear
/// Problems, section 3.3). Contiguous vectors.
class GaussNewton {
 public:
  virtual ~GaussNewton() = default;

  /// Moves y (N entries) at time t. WT: error weights, all > 0. `id` as in DenseRows. Fills the
  /// report's status, message, iterations, drift, rank and rows; y changes only on success.
  virtual void project(double t, std::vector<double>& y, const std::vector<double>& WT,
                       const std::vector<bool>& hold, const double* id,
                       ConsistencyReport& report) = 0;

  /// After project(): y' onto C y' + g_t = 0 (nearest in the weights), with g_t by central
  /// differences. False if g fails nearby.
  virtual bool tangent(double t, const std::vector<double>& y, double* yp) = 0;

  /// Did a callback ask for the end of the run in the last project() or tangent()? What it said.
  virtual bool fatal() const = 0;
  virtual const std::string& message() const = 0;
};

/// With sparse factors where a set has sparse rows.
std::unique_ptr<GaussNewton> make_gauss_newton(const Constraints& constraints, int size);

}  // namespace tether::ida_projection
