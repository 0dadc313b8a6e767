// Tether: the classical Coulomb law for one contact. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "local_geometry.hpp"

namespace tether::contact::detail {

// Sliding: w_t = -lambda x_t, so y_i = h_i / (beta_i + lambda) and the cone gives the secular
// equation s(lambda) = |y| + g.y = k (README, section 4). Newton on 1/s - 1/k, which is nearly
// linear, with a bracket. Above e = 0.8 several solutions may exist, among them one with b_n < 0
// (jam): then all are listed and the one nearest to the present impulse is taken.
struct Coulomb {
  static constexpr Law kLaw = Law::coulomb;
  static constexpr int kMaxEvaluations = 80;
  static constexpr double kManyBranches = 0.8;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double b0, double b1, double* x,
                                    double& lambda, int& evaluations) {
    if (L.e > kManyBranches) return nearest(L, bn, b0, b1, x, lambda, evaluations);
    if (!(bn > 0)) return separate(x);
    if (L.mu == 0) {
      x[0] = bn * L.inv_a;
      x[1] = x[2] = 0;
      return Regime::sliding;
    }
    const LocalRhs r = to_local(L, bn, b0, b1);
    const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;
    const double length = std::sqrt(s0 * s0 + s1 * s1);
    if (sticks(L, r, s0, s1, length)) return stick(L, r, bn, x);

    const double h = std::sqrt(r.h0 * r.h0 + r.h1 * r.h1), ik = 1 / r.k;
    if (!(h * ik < 1e300)) return separate(x);  // b_n > 0 only by underflow
    const bool order = L.beta[0] < L.beta[1];
    const double beta_min = order ? L.beta[0] : L.beta[1], beta_max = order ? L.beta[1] : L.beta[0];
    double lo = (1 - L.e) * h * ik - beta_max, hi = (1 + L.e) * h * ik - beta_min;
    if (lo < 0) lo = 0;
    if (hi < lo) hi = lo;
    double l = lambda;
    if (!(l > lo && l < hi)) {
      // Both beta replaced by their mean seen along h.
      const double gh = L.g[0] * r.h0 + L.g[1] * r.h1;
      const double beta = (L.beta[0] * r.h0 * r.h0 + L.beta[1] * r.h1 * r.h1) / (h * h);
      l = (h + gh) * ik - beta;
      if (!(l > lo)) l = lo;
      if (l > hi) l = hi;
    }
    refine(L, r, beta_min, lo, hi, l, evaluations);
    lambda = l;
    slide(L, r, l, x);
    return Regime::sliding;
  }

  static void derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                         Regime regime, LocalDerivative& out);

  // Root of s(l) = k in [lo, hi], s decreasing through it.
  static TETHER_INLINE void refine(const LocalBlock& L, const LocalRhs& r, double beta_min,
                                   double lo, double hi, double& l, int& evaluations) {
    // A Newton step of 3e-8 leaves round-off unless the two beta are far apart.
    const double stop = L.beta[0] + L.beta[1] < 1e3 * beta_min ? 3e-8 : 1e-12;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      ++evaluations;
      const double d0 = 1 / (L.beta[0] + l), d1 = 1 / (L.beta[1] + l);
      const double y0 = r.h0 * d0, y1 = r.h1 * d1;
      const double length = std::sqrt(y0 * y0 + y1 * y1), il = 1 / length;
      const double s = length + L.g[0] * y0 + L.g[1] * y1;
      const double ds = -((y0 * il + L.g[0]) * y0 * d0 + (y1 * il + L.g[1]) * y1 * d1);
      if (s > r.k) {
        lo = l;
      } else {
        hi = l;
      }
      const double step = s * (r.k - s) / (r.k * ds);
      double next = l + step;
      if (std::abs(step) <= stop * (l + beta_min) && ds * s * r.k < 0) {
        l = next < lo ? lo : (next > hi ? hi : next);
        return;
      }
      if (!(next > lo && next < hi) || !(ds < 0)) next = 0.5 * (lo + hi);
      if (next == l || hi - lo <= 1e-16 * (hi + beta_min)) return;
      l = next;
    }
  }

  // Normal impulse from the cone and the plane alike: |y| = mu x_n to round-off.
  static TETHER_INLINE void slide(const LocalBlock& L, const LocalRhs& r, double l, double* x) {
    const double y0 = r.h0 / (L.beta[0] + l), y1 = r.h1 / (L.beta[1] + l);
    const double length = std::sqrt(y0 * y0 + y1 * y1);
    const double scale = r.k / (length + L.g[0] * y0 + L.g[1] * y1);  // 1 up to round-off
    const double f = std::abs(scale - 1) < 1e-3 ? scale : 1;
    from_local(L, f * length / L.mu, f * y0, f * y1, x);
  }

  static Regime nearest(const LocalBlock& L, double bn, double b0, double b1, double* x,
                        double& lambda, int& evaluations);
};

}  // namespace tether::contact::detail
