// Tether: sensitivities of IDAS beside the state. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "attach/impl.hpp"
#include "sensitivity/corrector.hpp"

namespace tether::ida_projection {

void Projection::project_sensitivities(Sensitivities sensitivities,
                                       const tether_idas_functions& idas) {
  impl_->project_sensitivities(std::move(sensitivities), idas);
}
ConsistencyReport Projection::make_sensitivities_consistent(double t0, N_Vector yy, N_Vector yp,
                                                            N_Vector* s, N_Vector* sp) {
  return impl_->report_of("make_sensitivities_consistent", {yy, yp},
                          [&] { return impl_->make_sensitivities_consistent(t0, yy, yp, s, sp); });
}
ConsistencyReport Projection::project_gradient(double t, N_Vector yy, N_Vector v) {
  return impl_->report_of("project_gradient", {yy, v},
                          [&] { return impl_->project_gradient(t, yy, v); });
}

void Projection::Impl::project_sensitivities(Sensitivities given,
                                             const tether_idas_functions& idas) {
  if (movers_.used == nullptr) return;  // no constraints
  const std::string misused = why_misused("project_sensitivities", {});
  if (!misused.empty()) reject(misused);
  sensitivities_ = std::make_unique<SensitivityCorrector>(*this, std::move(given), idas);
}

ConsistencyReport Projection::Impl::make_sensitivities_consistent(double t0, N_Vector yy,
                                                                  N_Vector yp, N_Vector* s,
                                                                  N_Vector* sp) {
  ConsistencyReport report;
  report.status = Status::success;
  if (movers_.used == nullptr) return report;
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
  if (movers_.used == nullptr) return report;
  if (std::holds_alternative<UserProjection>(constraints_.jacobian))
    reject("project_gradient: a UserProjection tells no C; give the rows");
  if (std::holds_alternative<DistributedRows>(constraints_.jacobian))
    reject("project_gradient: DistributedRows are not taken");
  current_weights(yy);
  if (!gradient_)
    gradient_ = make_tangent_rows(constraints_, options_, statistics_, unknowns_.weights);
  auto* tangent = static_cast<TangentRows*>(gradient_.get());
  OwnedVector unit(yy), across(yy);
  N_VConst(1.0, unit);
  std::vector<double> r(static_cast<std::size_t>(tangent->rows()), 0.0);
  tangent->forget_failure();
  report.status = tangent->evaluate(t, yy, unknowns_.weights, nullptr);
  if (report.status == Status::success) report.status = tangent->factor(unit);
  if (report.status == Status::success) report.status = tangent->product(v, r.data());
  if (report.status == Status::success) {
    tangent->solve(r, across);
    N_VLinearSum(1.0, v, -1.0, across, v);
    for (const double rate : r) report.drift_before = std::max(report.drift_before, std::abs(rate));
  } else {
    report.message = tangent->message();
  }
  return report;
}

}  // namespace tether::ida_projection
