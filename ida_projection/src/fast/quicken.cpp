// Tether: fast operations for IDA's own vectors. SPDX-License-Identifier: BSD-3-Clause
#include "fast/kernels.hpp"

#include <cstring>
#include <nvector/nvector_serial.h>

#include "host/owned_vector.hpp"

// A host without serial vectors may lack it: then there is nothing to be made fast.
#pragma weak N_VNewEmpty_Serial

namespace tether::ida_projection::fast {

namespace {

bool is_serial(N_Vector v) {
  return v != nullptr && v->ops->nvgetvectorid != nullptr &&
         v->ops->nvgetvectorid(v) == SUNDIALS_NVEC_SERIAL && v->content != nullptr;
}

// All but those of its making and its end, which the plugin itself may watch.
bool same_operations(_generic_N_Vector_Ops own, const _generic_N_Vector_Ops& untouched) {
  own.nvclone = untouched.nvclone;
  own.nvcloneempty = untouched.nvcloneempty;
  own.nvdestroy = untouched.nvdestroy;
  return std::memcmp(&own, &untouched, sizeof own) == 0;
}

// A SUNDIALS compiled with fused multiply-adds has other bits than the kernels.
bool rounds_one_by_one(N_Vector like) {
  const OwnedVector x(like), y(like), sum(like);
  const double a = 1.0 + 0x1p-27;  // a^2 - 1 is 2^-26, fused 2^-26 + 2^-54
  N_VConst(a, x);
  N_VConst(-1.0, y);
  N_VLinearSum(a, x, 1.0, y, sum);
  const double* sums = N_VGetArrayPointer(sum);
  for (sunindextype i = 0; i < NV_LENGTH_S(like); ++i)
    if (sums[i] != 0x1p-26) return false;
  return true;
}

}  // namespace

void quicken(std::initializer_list<N_Vector> vectors, bool with_inputs) {
  if (&N_VNewEmpty_Serial == nullptr) return;
  Owned<N_Vector, N_VDestroy> untouched;
  for (N_Vector v : vectors) {
    if (!is_serial(v)) continue;
    if (!untouched) untouched.reset(N_VNewEmpty_Serial(NV_LENGTH_S(v), v->sunctx));
    if (!untouched) return;
    if (!same_operations(*v->ops, *untouched->ops)) continue;
    static const bool same_bits = rounds_one_by_one(v);
    if (same_bits) install_kernels(v->ops, NV_LENGTH_S(v), with_inputs);
  }
}

}  // namespace tether::ida_projection::fast
