// Tether: operations on serial vectors with the bits of SUNDIALS' own.
// SPDX-License-Identifier: BSD-3-Clause
//
// The order between elements may differ from SUNDIALS' loops, never within one: an
// element's products and sums stand as there, and sums over elements run from the first to the
// last. Cases that round alike are one case here: 1 x and -1 x are exact.
#pragma once

#include <initializer_list>
#include <sundials/sundials_nvector.h>

namespace tether::ida_projection::fast {

/// Vectors up to this length have kernels of their own length.
constexpr sunindextype kSized = 16;

/// Overwrites the operations of a vector that has `length` elements. `spreading`: vectors that are
/// combined, scaled or inverted into this one are made fast by quicken().
void install_kernels(N_Vector_Ops ops, sunindextype length, bool spreading);

/// Gives serial vectors of one length the kernels of fast_vector(), which have the bits of what
/// they replace. A vector of another kind, or with an operation that SUNDIALS did not put there (a
/// program may count or change them), stays as it is; so do null pointers. `with_inputs`: so do all
/// vectors that are combined, scaled or inverted into one of them from now on. These are IDA's
/// history, from which it predicts, its tolerances, and the solutions of its linear solver.
void quicken(std::initializer_list<N_Vector> vectors, bool with_inputs);

}  // namespace tether::ida_projection::fast
