// Tether: fast operations for IDA's own vectors. SPDX-License-Identifier: BSD-3-Clause
#include "fast/quicken.hpp"

#include <nvector/nvector_serial.h>

#include "fast/kernels.hpp"
#include "host/owned_vector.hpp"

// A host without serial vectors may lack it: then there is nothing to be made fast.
#pragma weak N_VNewEmpty_Serial

namespace tether::ida_projection::fast {

namespace {

bool is_serial(N_Vector v) {
  return v != nullptr && v->ops->nvgetvectorid != nullptr &&
         v->ops->nvgetvectorid(v) == SUNDIALS_NVEC_SERIAL && v->content != nullptr;
}

// In what install_kernels() overwrites.
bool same_operations(const _generic_N_Vector_Ops& a, const _generic_N_Vector_Ops& b) {
  return a.nvgetarraypointer == b.nvgetarraypointer && a.nvlinearsum == b.nvlinearsum &&
         a.nvconst == b.nvconst && a.nvprod == b.nvprod && a.nvdiv == b.nvdiv &&
         a.nvscale == b.nvscale && a.nvabs == b.nvabs && a.nvinv == b.nvinv &&
         a.nvaddconst == b.nvaddconst && a.nvdotprod == b.nvdotprod && a.nvmin == b.nvmin &&
         a.nvwrmsnorm == b.nvwrmsnorm && a.nvwrmsnormmask == b.nvwrmsnormmask &&
         a.nvwl2norm == b.nvwl2norm && a.nvlinearcombination == b.nvlinearcombination &&
         a.nvlinearsumvectorarray == b.nvlinearsumvectorarray &&
         a.nvscalevectorarray == b.nvscalevectorarray;
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

// `install` for each vector that has SUNDIALS' own operations.
void quicken_by(void (*install)(N_Vector_Ops, sunindextype),
                std::initializer_list<N_Vector> vectors) {
  if (&N_VNewEmpty_Serial == nullptr) return;
  N_Vector untouched = nullptr;
  for (N_Vector v : vectors) {
    if (!is_serial(v)) continue;
    if (untouched == nullptr) untouched = N_VNewEmpty_Serial(NV_LENGTH_S(v), v->sunctx);
    if (untouched == nullptr) return;
    if (!same_operations(*v->ops, *untouched->ops)) continue;
    static const bool same_bits = rounds_one_by_one(v);
    if (same_bits) install(v->ops, NV_LENGTH_S(v));
  }
  if (untouched != nullptr) N_VDestroy(untouched);
}

}  // namespace

void quicken(std::initializer_list<N_Vector> vectors) { quicken_by(install_kernels, vectors); }

void quicken_with_inputs(std::initializer_list<N_Vector> vectors) {
  quicken_by(install_spreading_kernels, vectors);
}

}  // namespace tether::ida_projection::fast
