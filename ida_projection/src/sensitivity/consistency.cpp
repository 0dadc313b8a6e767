// Tether: initial sensitivities onto the constraints. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "sensitivity/corrector.hpp"

namespace tether::ida_projection {

namespace {

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

}  // namespace

// With r(t, y) = C s + dg/dp: s by its shortest change, then s' from C s' + dr/dt along (y, y') at
// fixed s, the derivative by central differences of fourth order.
void SensitivityCorrector::make_consistent(double t, N_Vector y, N_Vector yp, N_Vector weights,
                                           N_Vector* s, N_Vector* sp, ConsistencyReport& report) {
  moved_ = nullptr;
  message_.clear();
  const Constraints& rows = state_.constraints_;
  rows_ = make_tangent_rows(rows, state_.options_, state_.statistics_, s_);
  row_terms_.assign(static_cast<std::size_t>(count()),
                    std::vector<double>(static_cast<std::size_t>(rows_->rows()), 0.0));
  r_ = row_terms_.front();
  N_VInv(weights, D_);
  OwnedVector at(y);
  // r_ and the factors of C at (t + e, y + e y').
  const auto residual = [&](int k, double e, N_Vector of) {
    N_VLinearSum(1.0, y, e, yp, at);
    Status status = rows_->evaluate(t + e, at, weights, state_.variables_.id());
    if (status == Status::success) status = rows_->factor(D_);
    if (status == Status::success) status = derivative(k, t + e, at);
    if (status == Status::success) status = rows_->product(of, r_.data());
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] += row_terms_[static_cast<std::size_t>(k)][i];
    return status;
  };
  const double speed = N_VMaxNorm(yp), size = N_VMaxNorm(y);
  const double e = 1e-3 * (speed > 0.0 && size > 0.0 ? size / speed : std::max(1.0, std::abs(t)));
  std::vector<OwnedVector> moved, moved_p;
  const auto fail = [&](Status status) {
    report.status = status;
    report.message = message_.empty() ? rows_->message() : message_;
  };
  for (int k = 0; k < count(); ++k) {
    moved.emplace_back(y);
    N_VScale(1.0, s[k], moved.back());
    Status status = residual(k, 0.0, moved.back());
    if (status != Status::success) return fail(status);
    report.drift_before = std::max(report.drift_before, largest(r_));
    rows_->solve(r_, work_);
    N_VLinearSum(1.0, moved.back(), -1.0, work_, moved.back());
    report.move = std::max(report.move, N_VWrmsNorm(work_, weights));
    report.largest_change = std::max(report.largest_change, N_VMaxNorm(work_));
    if ((status = residual(k, 0.0, moved.back())) != Status::success) return fail(status);
    report.drift_after = std::max(report.drift_after, largest(r_));
    if (sp == nullptr) continue;
    std::vector<double> rate(r_.size());
    status = central_differences(e, rate, r_, [&](double step, std::vector<double>&) {
      return residual(k, step, moved.back());
    });
    if (status != Status::success) return fail(status);
    if ((status = residual(k, 0.0, sp[k])) != Status::success) return fail(status);
    for (std::size_t i = 0; i < r_.size(); ++i)
      rate[i] += r_[i] - row_terms_[static_cast<std::size_t>(k)][i];
    rows_->solve(rate, work_);
    moved_p.emplace_back(y);
    N_VLinearSum(1.0, sp[k], -1.0, work_, moved_p.back());
    report.derivative_change = std::max(report.derivative_change, N_VMaxNorm(work_));
  }
  for (int k = 0; k < count(); ++k) {
    N_VScale(1.0, moved[static_cast<std::size_t>(k)], s[k]);
    if (sp != nullptr) N_VScale(1.0, moved_p[static_cast<std::size_t>(k)], sp[k]);
  }
  report.status = Status::success;
}

}  // namespace tether::ida_projection
