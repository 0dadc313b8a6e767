// Tether: the nearest point on the constraints, for starts and output points.
// SPDX-License-Identifier: BSD-3-Clause
#include "start/point.hpp"

#include <algorithm>
#include <cmath>

#include "host/owned_vector.hpp"

namespace tether::ida_projection {

void PointProjection::project(double t, N_Vector y, const std::vector<bool>& hold, N_Vector id,
                              N_Vector weights, ConsistencyReport& report) {
  if (has_values(constraints_)) return project_values(t, y, hold, id, weights, report);
  if (!mover_) {
    options_ = given_;
    options_.advanced.metric = Metric::error_weights;
    options_.advanced.largest_move = 1e300;
    options_.advanced.maximum_iterations = 50;
    options_.advanced.tolerance = 1e-8;
    mover_ = make_vector_mover(constraints_, options_, statistics_, y);
  }
  OwnedVector correction(y);
  N_VConst(0.0, correction);
  const Candidate candidate{t, y, correction, weights};
  mover_->rows().forget_failure();
  const Move move = mover_->move(candidate);
  report.status = move.status;
  report.iterations = move.moves;
  report.drift_before = move.drift_before;
  report.drift_after = move.drift_after;
  if (move.status != Status::success) {
    report.message = mover_->message();
    report.contradicting_rows = mover_->rows().contradicting;
    return;
  }
  N_VLinearSum(1.0, y, 1.0, correction, y);
}

std::vector<double> PointProjection::tolerances(N_Vector y, N_Vector weights) {
  const double *values = N_VGetArrayPointer(y), *w = N_VGetArrayPointer(weights);
  std::vector<double> WT(static_cast<std::size_t>(N_VGetLength(y)));
  for (std::size_t i = 0; i < WT.size(); ++i)
    WT[i] = w[i] > 0.0 ? 1.0 / w[i] : std::max(1.0, std::abs(values[i]));
  return WT;
}

// Did a callback end the run on the way, perhaps at a trial point?
bool PointProjection::refused(ConsistencyReport& report) const {
  if (!nearest_->fatal()) return false;
  report.status = Status::callback_fatal;
  report.message = nearest_->message();
  return true;
}

GaussNewton& PointProjection::nearest(N_Vector y) {
  if (!nearest_) nearest_ = make_gauss_newton(constraints_, static_cast<int>(N_VGetLength(y)));
  return *nearest_;
}

void PointProjection::project_values(double t, N_Vector y, const std::vector<bool>& hold,
                                     N_Vector id, N_Vector weights, ConsistencyReport& report) {
  double* values = N_VGetArrayPointer(y);
  std::vector<double> point(values, values + N_VGetLength(y));
  std::vector<bool> held = given_.hold;
  for (std::size_t i = 0; i < hold.size(); ++i)
    if (hold[i]) {
      held.resize(point.size(), false);
      held[i] = true;
    }
  nearest(y).project(t, point, tolerances(y, weights), held,
                     id != nullptr ? N_VGetArrayPointer(id) : nullptr, report);
  refused(report);
  if (report.status == Status::success) std::copy(point.begin(), point.end(), values);
}

bool PointProjection::tangent(double t, N_Vector y, N_Vector yp, ConsistencyReport& report) {
  if (!nearest_) return false;
  const double* values = N_VGetArrayPointer(y);
  const bool found =
      nearest_->tangent(t, {values, values + N_VGetLength(y)}, N_VGetArrayPointer(yp));
  return !refused(report) && found;
}

}  // namespace tether::ida_projection
