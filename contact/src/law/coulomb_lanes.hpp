// Tether: Coulomb's law for four contacts at a time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "law/coulomb.hpp"
#include "law/interface/lanes.hpp"

#if TETHER_GROUPS

namespace tether::contact::detail::avx2 {
namespace {

#define TETHER_TEXT TETHER_AVX2
#include "law/coulomb_slip.hpp"
#undef TETHER_TEXT

struct CoulombLanes {
  // Several solutions are possible: also a stick or a jam at b_n <= 0.
  TETHER_AVX2 v4 rare(const LaneBlocks& L, v4 h0, v4 h1, v4 touching) {
    const v4 many = less(all(Coulomb::kManyBranches * Coulomb::kManyBranches), L.ee);
    const v4 mixed = either(less(L.g0 * h0, all(0)), less(L.g1 * h1, all(0)));
    return both(both(many, mixed), either(touching, at_most(all(1), L.ee)));
  }

  TETHER_AVX2 Sliding slide(const LaneBlocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4, v4, v4, v4, v4,
                            v4 lambda, v4 wanted) {
    const v4 zero = all(0);
    // A tenth of the range in which several solutions may exist is left to the whole law.
    v4 rare = both(less(all(Coulomb::kManyBranches * Coulomb::kManyBranches), L.ee),
                   either(less(L.g0 * h0, zero), less(L.g1 * h1, zero)));
    const v4 h = root(h0 * h0 + h1 * h1), e = root(L.ee);
    const v4 beta_min = least(L.beta0, L.beta1), beta_max = most(L.beta0, L.beta1);
    const v4 grazing = at_most(all(1e60) * beta_max * k, h);
    k = choose(grazing, all(1), k);
    const v4 ik = all(1) / k;
    rare = either(rare, grazing);
    wanted = without(wanted, rare);
    auto [lo, hi] = slip_bracket(e, h, ik, beta_min, beta_max);
    const v4 gh = L.g0 * h0 + L.g1 * h1;
    const v4 mean = (L.beta0 * h0 * h0 + L.beta1 * h1 * h1) / most(h * h, all(1e-300));
    const v4 guess = least(most((h + gh) * ik - mean, lo), hi);
    v4 l = choose(both(less(lo, lambda), less(lambda, hi)), lambda, guess);
    const v4 stop = choose(less(beta_max, all(1e3) * beta_min), all(3e-8), all(1e-12));
    v4 active = wanted;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      const SlipEquation f = slip_equation(l, k, L.beta0, L.beta1, L.g0, L.g1, h0, h1, gh);
      const v4 above = less(zero, f.excess), rising = less(zero, k * f.slope);
      const v4 step = f.excess * f.q * f.z / or_one(rising, k * f.slope);
      lo = choose(above, l, lo);
      hi = choose(above, hi, l);
      v4 next = l + step;
      const v4 small = both(at_most(size(step), stop * (l + beta_min)), rising);
      const v4 inside = both(both(less(lo, next), less(next, hi)), rising);
      next = choose(small, least(most(next, lo), hi), choose(inside, next, 0.5 * (lo + hi)));
      const v4 done = either(small, either(_mm256_cmp_pd(next, l, _CMP_EQ_OQ),
                                           at_most(hi - lo, all(1e-16) * (hi + beta_min))));
      l = choose(active, next, l);
      active = without(active, done);
      if (!lanes(active)) break;
    }
    const v4 z0 = h0 * (L.beta1 + l), z1 = h1 * (L.beta0 + l), z = root(z0 * z0 + z1 * z1);
    const v4 f = bn * L.inv_a / (z + L.g0 * z0 + L.g1 * z1), fm = f * L.mu;
    return {f * z, fm * z0, fm * z1, l, rare};
  }
};

}  // namespace
}  // namespace tether::contact::detail::avx2

#endif
