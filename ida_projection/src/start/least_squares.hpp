// Tether: y' and algebraic variables consistent with F. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ida/ida.h>
#include <tether/ida_projection/projection.hpp>

namespace tether::ida_projection {

/// Gauss-Newton on F(t, y, y') = 0 over z = (y'_i differential, y_i algebraic), each correction the
/// least-squares solution of minimum norm (complete orthogonal decomposition), so redundant
/// multipliers and rows are allowed. Jacobian by differences. `id`: 1 differential, 0 algebraic,
/// null: all differential. `weights` are IDA's 1/WT. Contiguous vectors. success: F became small;
/// y and yp change only then. not_converged, or callback_fatal where F returned a negative flag.
Status consistent_derivative(IDAResFn residual, void* user_data, double t, N_Vector y, N_Vector yp,
                             N_Vector id, N_Vector weights, int maximum_iterations);

}  // namespace tether::ida_projection
