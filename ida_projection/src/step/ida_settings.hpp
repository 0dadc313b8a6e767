// Tether: the settings of IDA that control changes during a run. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <ida/ida.h>
#include <optional>
#include <tether/ida_projection/options.hpp>

namespace tether::ida_projection {

/// A bound of IDASetEtaFixedStepBounds that no ratio of steps reaches: keep h.
constexpr double kAnyRatio = 1e30;

/// Bounds of the next step size, by default IDA's own.
struct StepBounds {
  double lowest_fixed = 1.0, highest_fixed = 2.0;  ///< IDASetEtaFixedStepBounds
  double largest = 2.0;                            ///< IDASetEtaMax
  double low = 0.0;      ///< IDASetEtaLow and IDASetEtaMin; 0: as IDA has them
  double longest = 0.0;  ///< IDASetMaxStep, below Advanced::maximum_step; 0: none
};

/// The wishes of a controller for the rest of an attempt.
struct Control {
  StepBounds bounds = {};
  double weights_factor = 1.0;  ///< by which IDA's error weights are multiplied
};

/// The one place that writes settings of IDA in a run. No getter tells them.
class IdaSettings {
 public:
  IdaSettings(void* ida_mem, const Options& options) : ida_mem_(ida_mem), options_(options) {}

  /// The host may have set them: all are written the next time.
  void forget() { written_.reset(); }
  /// IDA checks what each function is given: those whose value stays are left out.
  void set(StepBounds to) {
    const double most = options_.advanced.maximum_step;
    if (to.longest == 0.0 || (most > 0.0 && most < to.longest)) to.longest = most;
    const auto changes = [&](double StepBounds::*value) {
      return !written_ || (*written_).*value != to.*value;
    };
    if (changes(&StepBounds::lowest_fixed) || changes(&StepBounds::highest_fixed))
      IDASetEtaFixedStepBounds(ida_mem_, to.lowest_fixed, to.highest_fixed);
    if (changes(&StepBounds::largest)) IDASetEtaMax(ida_mem_, to.largest);
    if (changes(&StepBounds::low)) {
      IDASetEtaLow(ida_mem_, to.low > 0.0 ? to.low : 0.9);
      IDASetEtaMin(ida_mem_, to.low > 0.0 ? to.low : 0.5);
    }
    if (options_.step_smoothing && changes(&StepBounds::longest))
      IDASetMaxStep(ida_mem_, to.longest);
    written_ = to;
  }
  void limit_order(int order) { IDASetMaxOrd(ida_mem_, order); }
  /// `id`: 1 for the variables of the error test; `suppresses`: only these are in it.
  void test(N_Vector id, bool suppresses) {
    IDASetSuppressAlg(ida_mem_, suppresses ? 1 : 0);
    IDASetId(ida_mem_, id);
  }

 private:
  void* ida_mem_;
  const Options& options_;
  std::optional<StepBounds> written_ = StepBounds();
};

}  // namespace tether::ida_projection
