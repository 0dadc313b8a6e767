// Tether: the point that the corrector has found. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_nvector.h>

namespace tether::ida_projection {

/// The candidate y = base + correction at time t, and IDA's reciprocal error weights 1/WT.
struct Candidate {
  double t;
  N_Vector base;        ///< IDA's prediction
  N_Vector correction;  ///< the corrector's ycor; the move is subtracted from it
  N_Vector weights;
  /// The entries of the three, for contiguous vectors; see with_entries().
  double* base_entries = nullptr;
  double* correction_entries = nullptr;
  const double* weight_entries = nullptr;
  /// y' = predicted_rate + cj correction; 0 and null where there is no step, as at a start.
  double h = 0.0, cj = 0.0;
  const double* predicted_rate = nullptr;

  Candidate& with_entries() {
    base_entries = N_VGetArrayPointer(base);
    correction_entries = N_VGetArrayPointer(correction);
    weight_entries = N_VGetArrayPointer(weights);
    return *this;
  }
};

}  // namespace tether::ida_projection
