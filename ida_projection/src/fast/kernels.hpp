// Tether: operations on serial vectors with the bits of SUNDIALS' own.
// SPDX-License-Identifier: BSD-3-Clause
//
// The order between elements may differ from SUNDIALS' loops, never within one: an
// element's products and sums stand as there, and sums over elements run from the first to the
// last. Cases that round alike are one case here: 1 x and -1 x are exact.
#pragma once

#include <sundials/sundials_nvector.h>

namespace tether::ida_projection::fast {

/// Vectors up to this length have kernels of their own length.
constexpr sunindextype kSized = 16;

/// Overwrites the operations of a vector that has `length` elements.
void install_kernels(N_Vector_Ops ops, sunindextype length);

/// The same, and vectors that are combined, scaled or inverted into this one are made fast by
/// quicken().
void install_spreading_kernels(N_Vector_Ops ops, sunindextype length);

}  // namespace tether::ida_projection::fast
