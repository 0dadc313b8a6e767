// Tether: the nearest point on the constraints, for starts and output points (method, section 11).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "movers/mover.hpp"
#include "start/gauss_newton.hpp"

namespace tether::ida_projection {

/// Moves single points, far ones too, in the error weights.
class PointProjection {
 public:
  PointProjection(const Constraints& constraints, const Options& options)
      : constraints_(constraints), given_(options) {}

  /// `weights`: reciprocal error weights; `id` as in Mover::set_algebraic(); `hold`: components
  /// that stay, beside those of the options. y changes only on success.
  void project(double t, N_Vector y, const std::vector<bool>& hold, N_Vector id, N_Vector weights,
               ConsistencyReport& report);
  /// Replaces yp by its part along the constraints at y. Returns false if it was not found;
  /// `report` tells if a callback ended the run.
  bool tangent(double t, N_Vector y, N_Vector yp, ConsistencyReport& report);

 private:
  static std::vector<double> tolerances(N_Vector y, N_Vector weights);
  GaussNewton& nearest(N_Vector y);
  bool refused(ConsistencyReport& report) const;
  void project_values(double t, N_Vector y, const std::vector<bool>& hold, N_Vector id,
                      N_Vector weights, ConsistencyReport& report);

  const Constraints& constraints_;
  const Options& given_;
  std::unique_ptr<GaussNewton> nearest_;
  std::unique_ptr<Mover> mover_;  // for rows without values
  Options options_;
  Statistics statistics_;
};

}  // namespace tether::ida_projection
