// Tether: the nearest point on the constraints, for starts and output points (method, section 11).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "host/owned_vector.hpp"
#include "movers/rows_at.hpp"

namespace tether::ida_projection {

/// Moves single points, far ones too: damped Gauss-Newton in the error weights, min |WT^-1 dy|
/// subject to C dy = g, with the natural monotonicity test. A step s dy is taken when the
/// simplified next correction C^+ g(y - s dy) is at most (1 - s/2) |dy| long; otherwise s is halved
/// (Deuflhard, Newton Methods for Nonlinear Problems, section 3.3).
class PointProjection {
 public:
  PointProjection(const Constraints& constraints, const Options& options)
      : constraints_(constraints), given_(options) {}

  /// `weights`: reciprocal error weights; `id` as in RowsAt::set_algebraic(); `hold`: components
  /// that stay, beside those of the options. y changes only on success. Fills the report's status,
  /// message, iterations, drift, rank and rows.
  void project(double t, N_Vector y, const std::vector<bool>& hold, N_Vector id, N_Vector weights,
               ConsistencyReport& report);
  /// After project() has found y: replaces yp by the nearest solution of C y' + g_t = 0 in the
  /// weights. Returns false if it was not found; `report` tells if a callback ended the run.
  bool tangent(double t, N_Vector y, N_Vector yp, N_Vector id, ConsistencyReport& report);

 private:
  void begin(N_Vector y, N_Vector weights);
  Status arrange(const Candidate& point, const std::vector<bool>& hold, N_Vector id);
  void newton(const Candidate& point, ConsistencyReport& report);
  bool damped_step(const Candidate& point, double length, double floor, double* left);
  bool found(ConsistencyReport& report);

  const Constraints& constraints_;
  const Options& given_;
  Options options_;
  Statistics statistics_;
  std::unique_ptr<RowsAt> rows_;
  std::vector<double> id_;  // those of the last arrange()
  OwnedVector correction_, weights_, from_, dy_;
};

}  // namespace tether::ida_projection
