// Tether: instantiates the kernels of a friction law. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "law/kernels/assembled_kernels.hpp"
#include "law/kernels/general_pass.hpp"
#include "law/kernels/group_pass.hpp"

namespace tether::contact::detail {
namespace {

// The whole law for one contact: singular blocks included.
template <class L>
TETHER_INLINE Regime solve_block(const LocalBlock& block, const double* b, double* x,
                                 double& lambda, int& evaluations) {
  Regime regime;
  if ((block.null[0] || block.null[1]) &&
      L::solve_singular(block, b[0], b[1], b[2], x, regime, evaluations)) {
    return regime;
  }
  return L::solve(block, b[0], b[1], b[2], x, lambda, evaluations);
}

}  // namespace
}  // namespace tether::contact::detail

#if TETHER_GROUPS
#define TETHER_GROUP_KERNELS(L, Lanes)                                                         \
  __attribute__((target("avx2,fma"))) Squares group_pass(const BodyArrays& s, GeneralGroup* b, \
                                                         GeneralGroup* e, Coupled c) {         \
    return c ? avx2::pass<L, avx2::Lanes, true>(s, b, e, c)                                    \
             : avx2::pass<L, avx2::Lanes, false>(s, b, e, c);                                  \
  }
#else
#define TETHER_GROUP_KERNELS(L, Lanes) \
  Squares group_pass(const BodyArrays&, GeneralGroup*, GeneralGroup*, Coupled) { return {}; }
#endif

// All kernels of the law L with the lanes Lanes, chosen for the processor, in an unnamed
// namespace of tether::contact::detail.
#define TETHER_LAW_KERNELS(L, Lanes)                                                               \
  TETHER_CLONES Regime solve(const LocalBlock& block, const double* b, double* x, double& lambda,  \
                             int& evaluations) {                                                   \
    return solve_block<L>(block, b, x, lambda, evaluations);                                       \
  }                                                                                                \
  TETHER_CLONES Squares body_sweep(const BodyArrays& s, GeneralContact* b, GeneralContact* e) {    \
    return pass<L, false>(s, b, e, nullptr);                                                       \
  }                                                                                                \
  TETHER_CLONES Squares body_test(const BodyArrays& s, GeneralContact* b, GeneralContact* e,       \
                                  Coupled c) {                                                     \
    return pass<L, true>(s, b, e, c);                                                              \
  }                                                                                                \
  TETHER_GROUP_KERNELS(L, Lanes)                                                                   \
  TETHER_ASSEMBLED_KERNELS(plain, Plain<L>)                                                        \
  constexpr LawKernels all_kernels(const LawKernels* replacement, const AssembledKernels* mixed) { \
    return {L::kLaw,      L::kName,    L::kFriction,                                               \
            solve,        L::gamma,    L::natural_point,                                           \
            L::tangent,   plain,       {body_sweep, body_test},                                    \
            {group_pass}, replacement, mixed};                                                     \
  }
