// Tether: contact without friction: kernels. SPDX-License-Identifier: BSD-3-Clause
#include "law/frictionless.hpp"

#include "law/kernels/define_law.hpp"

namespace tether::contact::detail {

#if TETHER_GROUPS
namespace avx2 {
namespace {

// Contacts without friction have sweeps of their own; if one gets here, the scalar text serves.
struct FrictionlessLanes {
  TETHER_AVX2 v4 rare(const LaneBlocks&, v4, v4, v4 touching) { return touching; }
  TETHER_AVX2 Sliding slide(const LaneBlocks&, v4 bn, v4, v4, v4, v4, v4, v4, v4, v4, v4 lambda,
                            v4) {
    return {bn, all(0), all(0), lambda, all(0)};
  }
};

}  // namespace
}  // namespace avx2
#endif

namespace {

TETHER_LAW_KERNELS(Frictionless, FrictionlessLanes)

}  // namespace

constexpr LawKernels Frictionless::kKernels = all_kernels(nullptr, nullptr);

}  // namespace tether::contact::detail
