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
    options_.metric = Metric::error_weights;
    options_.largest_move = 1e300;
    options_.maximum_iterations = 50;
    options_.tolerance = 1e-8;
    mover_ = make_vector_mover(constraints_, options_, statistics_, y);
  }
  OwnedVector correction(y);
  N_VConst(0.0, correction);
  const Candidate candidate{t, y, correction, weights};
  mover_->forget_failure();
  const Move move = mover_->move(candidate);
  report.status = move.status;
  report.iterations = move.moves;
  report.drift_before = move.drift_before;
  report.drift_after = move.drift_after;
  if (move.status != Status::success) {
    report.message = mover_->message();
    report.contradicting_rows = mover_->contradicting_rows();
    return;
  }
  N_VLinearSum(1.0, y, 1.0, correction, y);
}

void PointProjection::project_values(double t, N_Vector y, const std::vector<bool>& hold,
                                     N_Vector id, N_Vector weights, ConsistencyReport& report) {
  const auto size = static_cast<int>(N_VGetLength(y));
  const auto n = static_cast<std::size_t>(size);
  double* values = N_VGetArrayPointer(y);
  const double* w = N_VGetArrayPointer(weights);
  std::vector<double> point(values, values + size), WT(n);
  std::vector<bool> held = given_.hold;
  for (std::size_t i = 0; i < n; ++i) {
    WT[i] = w[i] > 0.0 ? 1.0 / w[i] : std::max(1.0, std::abs(point[i]));
    if (!hold.empty() && hold[i]) {
      held.resize(n, false);
      held[i] = true;
    }
  }
  if (!nearest_) nearest_ = make_gauss_newton(constraints_, size);
  nearest_->project(t, point, WT, held, id != nullptr ? N_VGetArrayPointer(id) : nullptr, report);
  if (nearest_->fatal()) {  // met on the way, perhaps at a trial point
    report.status = Status::callback_fatal;
    report.message = nearest_->message();
  }
  if (report.status == Status::success) std::copy(point.begin(), point.end(), values);
}

bool PointProjection::tangent(double t, N_Vector y, N_Vector yp, ConsistencyReport& report) {
  if (!nearest_) return false;
  const double* values = N_VGetArrayPointer(y);
  const bool found =
      nearest_->tangent(t, {values, values + N_VGetLength(y)}, N_VGetArrayPointer(yp));
  if (!nearest_->fatal()) return found;
  report.status = Status::callback_fatal;
  report.message = nearest_->message();
  return false;
}

}  // namespace tether::ida_projection
