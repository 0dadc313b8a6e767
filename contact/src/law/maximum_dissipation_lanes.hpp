// Tether: maximum dissipation for four contacts at a time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "law/interface/lanes.hpp"
#include "law/maximum_dissipation.hpp"

#if TETHER_GROUPS

namespace tether::contact::detail::avx2 {
namespace {

#define TETHER_TEXT TETHER_AVX2
#include "law/maximum_dissipation_arc.hpp"
#undef TETHER_TEXT

struct MaximumDissipationLanes {
  // No sticking or separating lane needs the rare parts of this law.
  TETHER_AVX2 v4 rare(const LaneBlocks&, v4, v4, v4) { return all(0); }

  TETHER_AVX2 Sliding slide(const LaneBlocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4 s0, v4 s1, v4 length,
                            v4 w0, v4 w1, v4 lambda, v4 wanted) {
    const v4 zero = all(0), one = all(1);
    const Arc a = visible_arc(k, L.beta0, L.beta1, L.g0, L.g1, h0, h1, s0, s1,
                              most(length, all(1e-300)), at_most(one, L.ee), w0, w1, wanted);
    const v4 q0 = a.q0, q1 = a.q1, q2 = a.q2, q3 = a.q3, q4 = a.q4;
    v4 lo = a.lo, hi = a.hi, t = a.t;
    const v4 d1 = 2.0 * q2, d2 = 3.0 * q3, d3 = 4.0 * q4;
    v4 active = wanted;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      const v4 f = (((q4 * t + q3) * t + q2) * t + q1) * t + q0;
      const v4 d = ((d3 * t + d2) * t + d1) * t + q1;
      const v4 below = less(f, zero);
      lo = choose(below, t, lo);
      hi = choose(below, hi, t);
      const v4 rising = less(zero, d), step = -f / or_one(rising, d), length_ = size(step);
      v4 next = t + step;
      const v4 small = both(at_most(length_, all(1e-8)), rising);
      const v4 inside = both(both(less(lo, next), less(next, hi)), rising);
      const v4 middle = 0.5 * (lo + hi);
      const v4 careful = choose(inside, next, middle);
      next = choose(small, least(most(next, lo), hi), careful);
      const v4 done =
          choose(small, at_most(length_, most(all(1e-8) * next, all(1e-12))),
                 either(_mm256_cmp_pd(next, t, _CMP_EQ_OQ), at_most(hi - lo, all(4e-17))));
      t = choose(active, next, t);
      active = without(active, done);
      if (!lanes(active)) break;
    }
    const auto [v0, v1] = direction(a, t);
    const v4 denominator = most(one + L.g0 * v0 + L.g1 * v1, all(1e-16) * (one + L.ee));
    const v4 opening = L.ee - one;
    const v4 id = one / denominator, radius = k * id;
    return {bn * L.inv_a * id, radius * v0, radius * v1, lambda,
            either(either(at_most(length, all(1e-140)), at_most(all(1e140), length)),
                   both(less(zero, opening), less(denominator, all(1e-3) * opening)))};
  }
};

}  // namespace
}  // namespace tether::contact::detail::avx2

#endif
