// Tether: the point that the corrector has found. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_nvector.h>

namespace tether::ida_projection {

/// The candidate y = base + correction at time t, and IDA's reciprocal error weights 1/WT.
struct Candidate {
  double t = 0.0;
  N_Vector base = nullptr;        ///< IDA's prediction
  N_Vector correction = nullptr;  ///< the corrector's ycor; the move is subtracted from it
  N_Vector weights = nullptr;
  /// IDA's prediction of y', to which cj correction is added; null where there is no step, as at a
  /// start.
  N_Vector predicted_slope = nullptr;
  /// The entries of the three, for contiguous vectors; see with_entries().
  double* base_entries = nullptr;
  double* correction_entries = nullptr;
  const double* weight_entries = nullptr;
  const double* predicted_rate = nullptr;  ///< of predicted_slope
  double h = 0.0, cj = 0.0;                ///< 0 where there is no step

  Candidate& with_entries() {
    base_entries = N_VGetArrayPointer(base);
    correction_entries = N_VGetArrayPointer(correction);
    weight_entries = N_VGetArrayPointer(weights);
    if (predicted_slope != nullptr) predicted_rate = N_VGetArrayPointer(predicted_slope);
    return *this;
  }
};

}  // namespace tether::ida_projection
