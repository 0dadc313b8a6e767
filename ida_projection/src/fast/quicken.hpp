// Tether: fast operations for IDA's own vectors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <sundials/sundials_nvector.h>

namespace tether::ida_projection::fast {

/// Gives serial vectors of one length the kernels of fast_vector(), which have the bits of what
/// they replace. A vector of another kind, or with an operation that SUNDIALS did not put there (a
/// program may count or change them), stays as it is; so do null pointers.
void quicken(std::initializer_list<N_Vector> vectors);

/// The same, and all that is combined, scaled or inverted into one of them from now on: IDA's
/// history, of which its predictions are made; tolerances, of which its weights are; what a linear
/// solver returns, of which corrections are.
void quicken_with_inputs(std::initializer_list<N_Vector> vectors);

}  // namespace tether::ida_projection::fast
