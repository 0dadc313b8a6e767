// Tether: the classical Coulomb law for one contact. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "local_geometry.hpp"

namespace tether::contact::detail {

// Sliding: w_t = -lambda x_t, so y_i = h_i / (beta_i + lambda) and the cone gives the secular
// equation s(lambda) = |y| + g.y = k (README, section 4). With p = (beta_0 + lambda)(beta_1 + lambda),
// z = p y and q = |z| + g.z it reads p / q = 1 / k, which is nearly linear in lambda: Newton with a
// bracket, one root and one division an evaluation. Its solutions are counted by f = k p - q, which
// is concave up to one point and convex beyond. Above e = 0.8 there may be three, with sticking, and
// at b_n < 0 (jam) two: unless there is only one, all are found and the one nearest to the present
// impulse is taken.
struct Coulomb {
  static constexpr Law kLaw = Law::coulomb;
  static constexpr int kMaxEvaluations = 80;
  static constexpr double kManyBranches = 0.8;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double b0, double b1, double* x,
                                    double& lambda, int& evaluations) {
    if (!(bn > 0) && L.e < 1) return separate(x);
    const LocalRhs r = to_local(L, bn, b0, b1);
    const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;
    const double length = std::sqrt(s0 * s0 + s1 * s1);
    if (L.e > kManyBranches && !(L.g[0] * r.h0 >= 0 && L.g[1] * r.h1 >= 0) && !L.unique) {
      if (!one_branch(L, r, bn, s0, s1, length)) return nearest(L, r, bn, x, lambda, evaluations);
    }
    if (!(bn > 0)) return separate(x);
    if (L.mu == 0) {
      x[0] = bn * L.inv_a;
      x[1] = x[2] = 0;
      return Regime::sliding;
    }
    if (sticks(L, r, s0, s1, length)) return stick(L, r, bn, x);

    const double h = std::sqrt(r.h0 * r.h0 + r.h1 * r.h1), ik = 1 / r.k;
    const bool order = L.beta[0] < L.beta[1];
    const double beta_min = order ? L.beta[0] : L.beta[1], beta_max = order ? L.beta[1] : L.beta[0];
    if (!(h * ik < 1e60 * beta_max)) return nearest(L, r, bn, x, lambda, evaluations);
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
      const double zh = z0 * r.h0 + z1 * r.h1;
      double slope = (e0 + e1) * q * z - p * (zh + z * gh);
      double step = excess * q * z / (r.k * slope);
      if (!(slope > 0 && q > 0.1 * z) || n > 8) {  // near the pole of p / q, e > 1: Newton for f
        slope = (r.k * (e0 + e1) - gh) * z - zh;
        step = excess * z / slope;
      }
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
    return slide(L, r, l, x);
  }

  static void derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                         Regime regime, LocalDerivative& out);

  // y = z / q scaled onto cone and plane: |y| + g.y = k holds to round-off whatever lambda is. Where q
  // cancels, z / p, which is on the cone.
  static TETHER_INLINE Regime slide(const LocalBlock& L, const LocalRhs& r, double l, double* x) {
    const double e0 = L.beta[0] + l, e1 = L.beta[1] + l;
    const double z0 = r.h0 * e1, z1 = r.h1 * e0, z = std::sqrt(z0 * z0 + z1 * z1);
    const double q = z + L.g[0] * z0 + L.g[1] * z1;
    const double f = std::abs(q) > 0.1 * z ? r.k / q : 1 / (e0 * e1);
    from_local(L, f * z / L.mu, f * z0, f * z1, x);
    return Regime::sliding;
  }

  // f rises throughout, or begins convex or negative and falling, with b_n > 0: one zero where it
  // begins negative, none where it begins at or above 0 and rises. b_n <= 0: f falls throughout.
  static TETHER_INLINE bool one_branch(const LocalBlock& L, const LocalRhs& r, double bn, double s0,
                                       double s1, double length) {
    if (!(length > 0)) return false;
    const bool slides = !sticks(L, r, s0, s1, length);
    const double straight = r.k * (L.beta[0] + L.beta[1]) - L.g[0] * r.h0 - L.g[1] * r.h1;
    const bool rises = straight * length >= s0 * r.h0 + s1 * r.h1;
    if (!rises && slides) return true;
    if (!(bn > 0)) return false;
    const double d = r.h0 * r.h1 * (L.beta[0] - L.beta[1]);
    if (rises && straight * straight >= r.h0 * r.h0 + r.h1 * r.h1) return true;
    return (slides || rises) && d * d <= 2 * r.k * length * length * length;
  }

  // All solutions, exactly; x: the nearest to x.
  static Regime nearest(const LocalBlock& L, const LocalRhs& r, double bn, double* x,
                        double& lambda, int& evaluations);
};

}  // namespace tether::contact::detail
