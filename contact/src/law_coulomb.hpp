// Tether: the classical Coulomb law for one contact. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "local_geometry.hpp"

namespace tether::contact::detail {

// Sliding: w_t = -lambda x_t, so y_i = h_i / (beta_i + lambda) and the cone gives the secular
// equation s(lambda) = |y| + g.y = k (README, section 4). With p = (beta_0 + lambda)(beta_1 + lambda),
// z = p y and q = |z| + g.z it reads p / q = 1 / k, which is nearly linear in lambda: Newton with a
// bracket, one root and one division an evaluation. Above e = 0.8 several solutions may exist, among
// them one with b_n < 0 (jam): unless one is ruled out, all are listed and the one nearest to the
// present impulse is taken.
struct Coulomb {
  static constexpr Law kLaw = Law::coulomb;
  static constexpr int kMaxEvaluations = 80;
  static constexpr double kManyBranches = 0.8;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double b0, double b1, double* x,
                                    double& lambda, int& evaluations) {
    if (!(bn > 0) && L.e < 1) return separate(x);
    const LocalRhs r = to_local(L, bn, b0, b1);
    if (L.e > kManyBranches && !(L.g[0] * r.h0 >= 0 && L.g[1] * r.h1 >= 0) && !L.unique) {
      return nearest(L, bn, b0, b1, x, lambda, evaluations);
    }
    if (!(bn > 0)) return separate(x);
    if (L.mu == 0) {
      x[0] = bn * L.inv_a;
      x[1] = x[2] = 0;
      return Regime::sliding;
    }
    const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;
    const double length = std::sqrt(s0 * s0 + s1 * s1);
    if (sticks(L, r, s0, s1, length)) return stick(L, r, bn, x);

    const double h = std::sqrt(r.h0 * r.h0 + r.h1 * r.h1), ik = 1 / r.k;
    const bool order = L.beta[0] < L.beta[1];
    const double beta_min = order ? L.beta[0] : L.beta[1], beta_max = order ? L.beta[1] : L.beta[0];
    if (!(h * ik < 1e60 * beta_max)) return nearest(L, bn, b0, b1, x, lambda, evaluations);
    // s lies between (1 - e) and (1 + e) times |y|; at e > 1 it may start lower.
    double lo = (1 - L.e) * h * ik - beta_max, hi = (1 + L.e) * h * ik - beta_min;
    if (!(lo > 0)) lo = 0;
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
    // A Newton step of 3e-8 leaves round-off unless the two beta are far apart.
    const double stop = beta_max < 1e3 * beta_min ? 3e-8 : 1e-12;
    const double gh = L.g[0] * r.h0 + L.g[1] * r.h1;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      ++evaluations;
      const double e0 = L.beta[0] + l, e1 = L.beta[1] + l, p = e0 * e1;
      const double z0 = r.h0 * e1, z1 = r.h1 * e0;
      const double z = std::sqrt(z0 * z0 + z1 * z1);
      const double q = z + L.g[0] * z0 + L.g[1] * z1;
      const double excess = q - r.k * p;  // has the sign of s - k
      // d(p/q) z q^2 = (p' q - p q') z with q' z = z.h + z g.h
      const double slope = (e0 + e1) * q * z - p * (z0 * r.h0 + z1 * r.h1 + z * gh);
      const double step = excess * q * z / (r.k * slope);
      if (excess > 0) {
        lo = l;
      } else {
        hi = l;
      }
      double next = l + step;
      if (std::abs(step) <= stop * (l + beta_min) && slope > 0) {
        l = next < lo ? lo : (next > hi ? hi : next);
        break;
      }
      if (!(next > lo && next < hi) || !(slope > 0)) next = 0.5 * (lo + hi);
      if (next == l || hi - lo <= 1e-16 * (hi + beta_min)) break;
      l = next;
    }
    lambda = l;
    // Scaled onto cone and plane: |y| + g.y = k holds to round-off whatever lambda is.
    const double z0 = r.h0 * (L.beta[1] + l), z1 = r.h1 * (L.beta[0] + l);
    const double z = std::sqrt(z0 * z0 + z1 * z1);
    const double f = bn * L.inv_a / (z + L.g[0] * z0 + L.g[1] * z1), fm = f * L.mu;
    from_local(L, f * z, fm * z0, fm * z1, x);
    return Regime::sliding;
  }

  static void derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                         Regime regime, LocalDerivative& out);

  static Regime nearest(const LocalBlock& L, double bn, double b0, double b1, double* x,
                        double& lambda, int& evaluations);
};

}  // namespace tether::contact::detail
