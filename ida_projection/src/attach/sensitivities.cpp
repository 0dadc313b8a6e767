// Tether: sensitivities of IDAS beside the state. SPDX-License-Identifier: BSD-3-Clause
#include "attach/impl.hpp"
#include "sensitivity/corrector.hpp"

namespace tether::ida_projection {

void Projection::Impl::project_sensitivities(Sensitivities given,
                                             const tether_idas_functions& idas) {
  if (movers_.used == nullptr) return;  // no constraints
  sensitivities_ = std::make_unique<SensitivityCorrector>(
      SensitivityCorrector::State{constraints_, options_, statistics_, report_, ida_, variables_,
                                  polish_, movers_.joined, movers_.own, run_.engaged},
      std::move(given), idas, ida_.step().y_predicted, unknowns_.contiguous);
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
  current_weights(yy);
  sensitivities_->make_consistent(t0, yy, yp, unknowns_.weights, s, sp, report);
  report_.status = report.status;
  report_.message = report.message;
  return report;
}

}  // namespace tether::ida_projection
