// Tether: blocks and results of a law for four contacts at a time. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "kernels/body_contacts.hpp"

#if TETHER_GROUPS
#include "kernels/body_lanes_avx2.hpp"

// The laws are those of the scalar files, with choices instead of branches; what both share is a
// text in the words of law/interface/real.hpp. In a packing the
// regimes of neighbours are hard to predict, and a wrong guess costs more than the arithmetic that
// it saves. Lanes that need the rare parts of a law are solved one by one afterwards.

namespace tether::contact::detail::avx2 {
namespace {

// Four blocks in the frame in which the tangential block is diagonal.
struct LaneBlocks {
  v4 a, inv_a, mu, c0, c1, g0, g1, ee, beta0, beta1;
};

// Tangential impulse y on the cone and the normal one, for lanes that slide; returns the lanes that
// this does not serve.
struct Sliding {
  v4 x0, x1, x2, lambda, rare;
};

}  // namespace
}  // namespace tether::contact::detail::avx2

#endif
