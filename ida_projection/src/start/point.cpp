// Tether: the nearest point on the constraints, for starts and output points.
// SPDX-License-Identifier: BSD-3-Clause
#include "start/point.hpp"

#include <algorithm>
#include <cmath>

#include "host/rounding.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kConverged = 1e-8;  // tolerances: quadratic convergence makes this round-off

}  // namespace

void PointProjection::begin(N_Vector y, N_Vector weights) {
  if (!rows_) {
    options_ = given_;
    options_.advanced.metric = Metric::error_weights;
    rows_ = make_rows(constraints_, options_, statistics_, y);
    for (OwnedVector* each : {&correction_, &weights_, &from_, &dy_}) *each = OwnedVector(y);
  }
  rows_->reset();
  N_VConst(0.0, correction_);
  N_VScale(1.0, weights, weights_);
  if (!has_values(constraints_)) return;
  double* w = N_VGetArrayPointer(weights_);
  for (sunindextype i = 0; i < N_VGetLength(y); ++i)
    if (!(w[i] > 0.0)) w[i] = 1.0 / std::max(1.0, std::abs(N_VGetArrayPointer(y)[i]));
}

// Output points come one after the other: what can move stays. Blocks that depend on the entries
// which differed from zero so far are found anew: a point owes nothing to those before it.
Status PointProjection::arrange(const Candidate& point, const std::vector<bool>& hold,
                                N_Vector id) {
  if (!has_values(constraints_)) return Status::success;
  const auto n = static_cast<std::size_t>(N_VGetLength(point.base));
  const double* given = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
  const std::vector<double> mask(given, given != nullptr ? given + n : given);
  std::vector<bool> held = given_.hold;
  for (std::size_t i = 0; i < hold.size(); ++i)
    if (hold[i]) {
      held.resize(n, false);
      held[i] = true;
    }
  if (mask == id_ && held == options_.hold && rows_->keeps_blocks()) return Status::success;
  options_.hold = held;
  const Status status = rows_->set_algebraic(point, id, {});
  if (status == Status::success)
    id_ = mask;
  else
    id_.assign(1, -1.0);  // of no point
  return status;
}

// The largest s = 1, 1/2, ... for which the natural monotonicity test holds. `left`: length of the
// simplified next correction. False: there is none, and the point is back where it was.
bool PointProjection::damped_step(const Candidate& point, double length, double floor,
                                  double* left) {
  for (double s = 1.0; s >= 1.0 / 1024.0; s *= 0.5) {
    N_VLinearSum(1.0, from_, -s, dy_, point.correction);
    rows_->follow(point, nullptr);
    if (rows_->value(point.t, false) != Status::success) {
      if (rows_->report.fatal) return false;
      continue;
    }
    *left = rows_->solve(Solve::point).length;
    if (*left <= (1.0 - 0.5 * s) * length + floor) return true;
  }
  N_VScale(1.0, from_, point.correction);
  rows_->follow(point, nullptr);
  return false;
}

void PointProjection::newton(const Candidate& point, ConsistencyReport& report) {
  if ((report.status = rows_->load(point, true)) != Status::success ||
      (report.status = rows_->value(point.t, true)) != Status::success)
    return;
  report.drift_before = rows_->drift;
  double previous = -1.0;
  int halvings_in_a_row = 0;
  for (report.iterations = 0; report.iterations < 60; ++report.iterations) {
    report.status = rows_->factor(point.t, report.iterations == 0);
    if (report.status != Status::success) return;
    const Solution next = rows_->solve(Solve::point);
    report.rank = next.rank;
    const double length = next.length;
    const double floor = 64.0 * kEpsilon * N_VWrmsNorm(point.base, point.weights);
    if (length <= std::max(kConverged, floor)) return;
    // Rounding: small already, and no longer shrinking.
    if (previous >= 0.0 && length <= 1e4 * floor && length > 0.5 * previous) return;
    // Gradients that vanish on the set: the distance halves, |g| falls to a quarter.
    const double rate = previous > 0.0 ? length / previous : 0.0;
    halvings_in_a_row = rate > 0.4 && rate < 0.6 ? halvings_in_a_row + 1 : 0;
    if (halvings_in_a_row >= 4) report.slow_convergence = true;
    previous = length;

    N_VScale(1.0, point.correction, from_);
    if ((report.status = rows_->apply(1.0, point)) != Status::success) return;
    if (rows_->kind == RowsAt::Kind::projection) {
      ++report.iterations;
      return;
    }
    N_VLinearSum(1.0, from_, -1.0, point.correction, dy_);
    double left = 0.0;
    if (!damped_step(point, length, floor, &left)) {
      // Almost dependent rows magnify rounding into moves that lead nowhere.
      report.status = rows_->value(point.t, false);
      if (report.status == Status::success && !rows_->is_rounding())
        report.status = Status::not_converged;
      return;
    }
    // Seen with the current factors: others would only confirm it, where no row waits to come back.
    if (rows_->factors == RowsAt::Factors::of_all_rows && left <= std::max(kConverged, floor)) {
      ++report.iterations;
      return;
    }
  }
  report.status = Status::not_converged;
}

// Says what became of newton().
bool PointProjection::found(ConsistencyReport& report) {
  report.drift_after = rows_->drift;
  const bool ended = report.status == Status::success || report.status == Status::not_converged;
  if (rows_->report.fatal) {
    report.status = Status::callback_fatal;
    report.message = rows_->report.text;
  } else if (!ended) {
    report.message = rows_->report.text;
  } else if (rows_->contradicts()) {
    report.status = Status::inconsistent;
    report.message = rows_->report.text;
    report.contradicting_rows = rows_->report.rows;
  } else if (report.status == Status::not_converged) {
    report.message = "no point on the constraints was found near the given one: |g| is " +
                     brief(report.drift_before) + " there and stalls at " +
                     brief(report.drift_after) +
                     "; the rows may have no common solution, or the start is too far away";
  } else if (report.slow_convergence) {
    report.message =
        "gradients vanish on the constraints: Newton's method only halves the distance, and |g| "
        "says little about it; write the rows without squares";
  }
  return report.status == Status::success;
}

void PointProjection::project(double t, N_Vector y, const std::vector<bool>& hold, N_Vector id,
                              N_Vector weights, ConsistencyReport& report) {
  begin(y, weights);
  Candidate point{t, y, correction_, weights_};
  if (has_values(constraints_)) point.with_entries();
  rows_->report.fatal = false;
  report.status = arrange(point, hold, id);
  if (report.status == Status::success) newton(point, report);
  if (found(report)) N_VLinearSum(1.0, y, 1.0, correction_, y);
}

// y' <- y' - dy' with C dy' = C y' + g_t, g_t by central differences.
bool PointProjection::tangent(double t, N_Vector y, N_Vector yp, N_Vector id,
                              ConsistencyReport& report) {
  if (!rows_ || rows_->kind != RowsAt::Kind::entries) return false;
  const double h = std::cbrt(kEpsilon) * std::max(1.0, std::abs(t));
  const auto m = static_cast<std::size_t>(rows_->count());
  std::vector<double> ahead(m), behind(m), defect(m);
  N_VInv(weights_, dy_);
  const bool known = rows_->value_at(t + h, y, ahead) == Status::success &&
                     rows_->value_at(t - h, y, behind) == Status::success &&
                     rows_->linearise(t, y, weights_, id, {}) == Status::success &&
                     rows_->factor_in(dy_) == Status::success &&
                     rows_->product(yp, defect) == Status::success;
  for (std::size_t i = 0; i < m; ++i) defect[i] += (ahead[i] - behind[i]) / (2.0 * h);
  if (known) {
    rows_->solve_for(defect, dy_);
    N_VLinearSum(1.0, yp, -1.0, dy_, yp);
  }
  if (rows_->report.fatal) {
    report.status = Status::callback_fatal;
    report.message = rows_->report.text;
  }
  return known;
}

}  // namespace tether::ida_projection
