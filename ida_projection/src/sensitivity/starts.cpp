// Tether: sensitivities of IDAS beside the state: their start, and dg/dp. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "host/rounding.hpp"
#include "host/shortest.hpp"
#include "sensitivity/corrector.hpp"

namespace tether::ida_projection {

namespace {

// A parameter of the host, put back whatever happens.
struct Shifted {
  double* p;
  double value = *p;
  ~Shifted() { *p = value; }
};

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

}  // namespace

void Projection::project_sensitivities(Sensitivities sensitivities) {
  own(impl_).project_sensitivities(std::move(sensitivities));
}
ConsistencyReport Projection::make_sensitivities_consistent(double t0, N_Vector yy, N_Vector yp,
                                                            N_Vector* s, N_Vector* sp) {
  return own(impl_).report_of("make_sensitivities_consistent", {yy, yp}, [&] {
    return impl_->make_sensitivities_consistent(t0, yy, yp, s, sp);
  });
}
ConsistencyReport Projection::project_gradient(double t, N_Vector yy, N_Vector v) {
  return own(impl_).report_of("project_gradient", {yy, v},
                              [&] { return impl_->project_gradient(t, yy, v); });
}

void Projection::Impl::project_sensitivities(Sensitivities given) {
  if (rows_.used == nullptr) return;  // no constraints
  const std::string misused = why_misused("project_sensitivities", {});
  if (!misused.empty()) reject(misused);
  sensitivities_ = std::make_unique<SensitivityCorrector>(*this, std::move(given));
}

ConsistencyReport Projection::Impl::make_sensitivities_consistent(double t0, N_Vector yy,
                                                                  N_Vector yp, N_Vector* s,
                                                                  N_Vector* sp) {
  ConsistencyReport report;
  report.status = Status::success;
  if (rows_.used == nullptr) return report;
  if (!sensitivities_)
    reject("make_sensitivities_consistent: call project_sensitivities before, which knows dg/dp");
  if (yy == nullptr || yp == nullptr || s == nullptr)
    reject("make_sensitivities_consistent: yy, yp and s must not be null");
  auto& sensitivities = static_cast<SensitivityCorrector&>(*sensitivities_);
  for (int k = 0; k < sensitivities.count(); ++k)
    for (N_Vector v : {s[k], sp != nullptr ? sp[k] : s[k]})
      if (v == nullptr || !why_unlike_y(v).empty())
        reject("make_sensitivities_consistent: vector " + std::to_string(k) + " of s or sp " +
               (v == nullptr ? "is null" : "is unlike y: " + why_unlike_y(v)));
  current_weights(yy);
  sensitivities.make_consistent(t0, yy, yp, unknowns_.weights, s, sp, report);
  return report;
}

ConsistencyReport Projection::Impl::project_gradient(double t, N_Vector yy, N_Vector v) {
  ConsistencyReport report;
  report.status = Status::success;
  if (yy == nullptr || v == nullptr) reject("project_gradient: yy and v must not be null");
  if (rows_.used == nullptr) return report;
  if (std::holds_alternative<UserProjection>(constraints_.jacobian))
    reject("project_gradient: a UserProjection tells no C; give the rows");
  if (std::holds_alternative<DistributedRows>(constraints_.jacobian))
    reject("project_gradient: DistributedRows are not taken");
  current_weights(yy);
  if (!gradient_) gradient_ = make_rows(constraints_, options_, statistics_, unknowns_.weights);
  RowsAt& rows = *gradient_;
  OwnedVector unit(yy), across(yy);
  N_VConst(1.0, unit);
  std::vector<double> r(static_cast<std::size_t>(rows.count()), 0.0);
  rows.report.fatal = false;
  report.status = rows.linearise(t, yy, unknowns_.weights, nullptr, {});
  if (report.status == Status::success) report.status = rows.factor_in(unit);
  if (report.status == Status::success) report.status = rows.product(v, r);
  if (report.status == Status::success) {
    rows.solve_for(r, across);
    N_VLinearSum(1.0, v, -1.0, across, v);
    report.drift_before = largest(r);
  } else {
    report.message = rows.report.text;
  }
  return report;
}

// With r(t, y) = C s + dg/dp: s by its shortest change, then s' from C s' + dr/dt along (y, y') at
// fixed s, the derivative by central differences of fourth order.
void SensitivityCorrector::make_consistent(double t, N_Vector y, N_Vector yp, N_Vector weights,
                                           N_Vector* s, N_Vector* sp, ConsistencyReport& report) {
  moved_ = nullptr;
  message_.clear();
  const Constraints& rows = state_.constraints_;
  rows_ = make_rows(rows, state_.options_, state_.statistics_, s_);
  row_terms_.assign(static_cast<std::size_t>(count()),
                    std::vector<double>(static_cast<std::size_t>(rows_->count()), 0.0));
  r_ = row_terms_.front();
  OwnedVector at(y), D(y);
  N_VInv(weights, D);
  // r_ and the factors of C at (t + e, y + e y').
  const auto residual = [&](int k, double e, N_Vector of) {
    N_VLinearSum(1.0, y, e, yp, at);
    Status status = rows_->linearise(t + e, at, weights, state_.variables_.id(), {});
    if (status == Status::success) status = rows_->factor_in(D);
    if (status == Status::success) status = derivative(k, t + e, at);
    if (status == Status::success) status = rows_->product(of, r_);
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] += row_terms_[static_cast<std::size_t>(k)][i];
    return status;
  };
  const double speed = N_VMaxNorm(yp), size = N_VMaxNorm(y);
  const double e =
      kWideIncrement * (speed > 0.0 && size > 0.0 ? size / speed : std::max(1.0, std::abs(t)));
  std::vector<OwnedVector> moved, moved_p;
  const auto fail = [&](Status status) {
    report.status = status;
    report.message = text();
  };
  for (int k = 0; k < count(); ++k) {
    moved.emplace_back(y);
    N_VScale(1.0, s[k], moved.back());
    Status status = residual(k, 0.0, moved.back());
    if (status != Status::success) return fail(status);
    report.drift_before = std::max(report.drift_before, largest(r_));
    rows_->solve_for(r_, work_);
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
    rows_->solve_for(rate, work_);
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

// dg/dp_k for the rows of the caller: the caller's function, extrapolated central differences of g
// in p_k, or zero.
Status SensitivityCorrector::derivative(int k, double t, N_Vector y) {
  std::vector<double>& g_p = row_terms_[static_cast<std::size_t>(k)];
  std::fill(g_p.begin(), g_p.end(), 0.0);
  const auto name = [k] { return "dg/dp of parameter " + std::to_string(k); };
  if (given_.derivative || given_.vector_derivative) {
    std::string thrown;
    const auto call = [&] {
      if (given_.vector_derivative) return given_.vector_derivative(t, y, k, g_p.data());
      return given_.derivative(t, ConstVector(N_VGetArrayPointer(y), N_VGetLength(y)), k,
                               Vector(g_p.data(), state_.constraints_.total_count()));
    };
    const int flag = guarded(call, thrown);
    if (flag != 0) {
      RowsReport report;
      const Status status = report.failed(flag, name(), thrown, 0);
      message_ = report.text;
      return status;
    }
  } else if (given_.parameters != nullptr) {
    const Status status = differences(k, t, y, g_p);
    if (status != Status::success) return status;
  }
  if (all_finite(g_p.data(), g_p.size())) return Status::success;
  message_ = name() + " is not finite at t = " + brief(t);
  return Status::not_finite;
}

Status SensitivityCorrector::differences(int parameter, double t, N_Vector y,
                                         std::vector<double>& g_p) {
  const auto k = static_cast<std::size_t>(parameter);
  const Shifted p{given_.parameters + (given_.list.empty() ? parameter : given_.list[k])};
  const double size = std::abs(given_.scales.empty() ? p.value : given_.scales[k]);
  // A power of two: p + d - p is d.
  const double d = std::exp2(std::round(std::log2(kWideIncrement * (size > 0.0 ? size : 1.0))));
  shifted_.resize(g_p.size());
  return central_differences(d, g_p, shifted_, [&](double e, std::vector<double>& g) {
    *p.p = p.value + e;
    return rows_->value_at(t, y, g);
  });
}

}  // namespace tether::ida_projection
