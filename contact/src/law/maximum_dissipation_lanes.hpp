// Tether: maximum dissipation for four contacts at a time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "law/lanes.hpp"
#include "law/maximum_dissipation.hpp"

#if TETHER_GROUPS

namespace tether::contact::detail::avx2 {
namespace {

struct MaximumDissipationLanes {
  // No sticking or separating lane needs the rare parts of this law.
  TETHER_AVX2 v4 rare(const LaneBlocks&, v4, v4, v4) { return all(0); }

  TETHER_AVX2 Sliding slide(const LaneBlocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4 s0, v4 s1, v4 length,
                            v4 w0, v4 w1, v4 lambda, v4 wanted) {
    const v4 zero = all(0), one = all(1);
    const v4 il = one / most(length, all(1e-300)), u0 = s0 * il, u1 = s1 * il;
    const v4 kappa = (k * L.beta0 * L.beta1 - L.g0 * s0 - L.g1 * s1) * il;
    const v4 p1 = u0 * h0 + u1 * h1, p2 = u0 * h1 - u1 * h0;
    const v4 g1 = u0 * L.g0 + u1 * L.g1;
    v4 g2 = u0 * L.g1 - u1 * L.g0;
    const v4 kb0 = k * L.beta0, kb1 = k * L.beta1;
    const v4 B12 = u0 * u1 * (kb1 - kb0);
    const v4 M11 = kb0 * u0 * u0 + kb1 * u1 * u1 - p1 * g1, M12 = B12 - p1 * g2;
    const v4 M21 = B12 - p2 * g1, M22 = kb0 * u1 * u1 + kb1 * u0 * u0 - p2 * g2;
    const v4 S = p1 + M22 * g1 - M12 * g2, C = M21 * g1 - M11 * g2 - p2;
    const v4 K = p1 * g2 - p2 * g1, dM = M22 - M11;
    v4 q0 = M21 + C + K, q1 = 2.0 * (S + dM), q2 = 2.0 * (K - M21) - 4.0 * M12, q3 = 2.0 * (S - dM);
    v4 q4 = M21 - C + K;
    const v4 side = choose(less(zero, q0), -one, one);
    q0 = q0 * side;
    q2 = q2 * side;
    q4 = q4 * side;
    g2 = g2 * side;
    const v4 bounded = less(all(-1), kappa);
    v4 far = root(most((one - kappa) / or_one(bounded, one + kappa), zero));
    far = choose(bounded, far, all(1e150));
    const v4 open = at_most(one, L.ee);
    if (lanes(both(open, wanted))) {  // before the asymptote
      const v4 A = one - g1, D = g2 * g2 - A * (one + g1), r = root(most(D, zero));
      const v4 before = less(g2, zero), beyond = less(A, zero);
      const v4 cut = choose(before, (one + g1) / or_one(before, r - g2),
                            choose(beyond, -(g2 + r) / or_one(beyond, A), all(-1)));
      const v4 use = both(both(open, at_most(zero, D)), both(less(zero, cut), less(cut, far)));
      far = choose(use, cut, far);
    }
    // Warm start: the direction of the present impulse.
    const v4 w = root(w0 * w0 + w1 * w1), down = w + u0 * w0 + u1 * w1;
    const v4 ahead = less(all(1e-12) * w, down);
    v4 t = choose(ahead, side * (u0 * w1 - u1 * w0) / or_one(ahead, down), zero);
    const v4 inverted = both(less(one, far), less(q0 + q1 + q2 + q3 + q4, zero));
    v4 lo = zero, hi = least(far, one);
    if (lanes(both(inverted, wanted))) {
      const v4 r0 = q0, r1 = q1;
      q0 = choose(inverted, -q4, q0);
      q1 = choose(inverted, -q3, q1);
      q2 = choose(inverted, -q2, q2);
      q3 = choose(inverted, -r1, q3);
      q4 = choose(inverted, -r0, q4);
      lo = choose(inverted, one / most(far, one), lo);
      hi = choose(inverted, one, hi);
      t = choose(inverted, choose(less(zero, t), one / most(t, all(1e-300)), one), t);
    }
    t = least(most(t, lo), hi);
    const v4 d1 = 2.0 * q2, d2 = 3.0 * q3, d3 = 4.0 * q4;
    v4 active = wanted;
    for (int n = 0; n < MaximumDissipation::kMaxEvaluations; ++n) {
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
    v4 co = one - t * t, si = 2.0 * t * side;
    co = choose(inverted, -co, co);
    const v4 in = one / (one + t * t);
    co = co * in;
    si = si * in;
    const v4 v0 = co * u0 - si * u1, v1 = co * u1 + si * u0;
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
