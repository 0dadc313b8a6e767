// Tether: the classical Coulomb law for one contact. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "law/interface/local_geometry.hpp"
#include <tether/linalg/friction_cone.hpp>

namespace tether::contact::detail {

struct LawKernels;

// Sliding: w_t = -lambda x_t, so y_i = h_i / (beta_i + lambda) and the cone gives the secular
// equation |y| + g.y = k (method, eq. 12). With p = (beta_0 + lambda)(beta_1 + lambda), z = p y
// and w = k p - g.z it is w = |z|; its solutions are counted by f = w - |z|, which is concave up to
// one point and convex beyond. Above e = 0.8 there may be three, with sticking, and at b_n < 0
// (jam) two: unless the one found is the only one, all are found and the one nearest to the present
// impulse is taken.
struct Coulomb : OppositeSlip {
  static constexpr Law kLaw = Law::coulomb;
  static constexpr const char* kName = "coulomb";
  static constexpr bool kFriction = true;
  static const LawKernels kKernels;
  static constexpr int kFastEvaluations = 8;
  static constexpr double kManyBranches = 0.8;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double b0, double b1, double* x,
                                    double& lambda, int& evaluations) {
    if (!(bn > 0) && L.e < 1) return separate(x);
    const LocalRhs r = to_local(L, bn, b0, b1);
    const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;
    const bool one =
        (L.e <= kManyBranches) | L.unique | ((L.g[0] * r.h0 >= 0) & (L.g[1] * r.h1 >= 0));
    if (!(bn > 0)) {
      if (one || falls(L, r, s0, s1)) return separate(x);
      return nearest(L, r, bn, x, lambda, evaluations);
    }
    if (L.mu == 0) {
      x[0] = bn * L.inv_a;
      x[1] = x[2] = 0;
      return Regime::sliding;
    }
    const double room = r.k * L.beta[0] * L.beta[1] - L.g[0] * s0 - L.g[1] * s1;
    if (room >= 0 && s0 * s0 + s1 * s1 <= room * room) {
      if (one || rises(L, r, s0, s1)) return stick(L, r, bn, x);
      return nearest(L, r, bn, x, lambda, evaluations);
    }

    double l = lambda;
    if (!halley(L, r, s0, s1, room, l, evaluations) && !safeguarded(L, r, lambda, l, evaluations))
      return nearest(L, r, bn, x, lambda, evaluations);
    if (!(one | only(L, r, room, l)) && !only_two(L, r, room, l))
      return nearest(L, r, bn, x, lambda, evaluations);
    lambda = l;
    return slide(L, r, bn, l, x);
  }

  static TETHER_INLINE void natural_point(const LocalBlock& L, const double* x, const double* w,
                                          double* v) {
    cone_natural_point(L.mu, 0, 0, x, w, v);
  }
  static void tangent(const LocalBlock& L, const double* x, const double* w, LawTangent& out) {
    cone_tangent(L, nullptr, x, w, out);
  }
  static void derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                         Regime regime, LocalDerivative& out);

  // Root of P / Z, P = w^2 - Z, w = k p - g.z, Z = z.z: no square root, and for equal beta without
  // g a parabola. Halley's method from l, if > 0. room: w at 0. false: a bracket is needed.
  static TETHER_INLINE bool halley(const LocalBlock& L, const LocalRhs& r, double s0, double s1,
                                   double room, double& l, int& evaluations) {
    const double hh = r.h0 * r.h0 + r.h1 * r.h1, gh = L.g[0] * r.h0 + L.g[1] * r.h1;
    const double w1 = r.k * (L.beta[0] + L.beta[1]) - gh, Z0 = s0 * s0 + s1 * s1;
    const double Z1 = s0 * r.h0 + s1 * r.h1;
    const double beta_min = L.beta[0] < L.beta[1] ? L.beta[0] : L.beta[1];
    int starts = l > 0 ? 2 : 1;
    if (!(l > 0)) l = start(L, r, hh, gh);
    for (int n = 0; n < kFastEvaluations; ++n) {
      ++evaluations;
      const double half_dZ = Z1 + l * hh, Z = Z0 + l * (Z1 + half_dZ);
      const double w = room + l * (w1 + l * r.k), dw = w1 + 2 * l * r.k;
      const double P = w * w - Z, T = dw * Z - w * half_dZ;  // (P/Z)' = 2 w T / Z^2
      const double A = w * T, AA = A * A;
      const double B = (dw * dw + 2 * r.k * w) * Z - w * w * hh;  // (P''Z - P Z'') / 2
      const double curved = P * (0.25 * Z * B - half_dZ * A);
      const double step = -0.5 * P * Z * A / (AA - curved), next = l + step;
      if ((w > 0) & (T > 0) & (AA > curved) & (next >= 0)) {
        l = next;
        // A step of third order leaves the cube of it.
        if ((std::abs(step) <= 1e-5 * (l + beta_min)) & (std::abs(curved) <= 1e-5 * AA))
          return l < 1e30;  // a step that overflows is no step
        if (starts < 2 || P < 8 * Z) continue;
      }
      // Too far for Halley (a pole of its step, P' < 0, overflow), or a start of which little is
      // left: another start, then a bracket.
      if (--starts < 0) break;
      if (starts == 0 && w > 0) break;
      l = starts == 1 ? start(L, r, hh, gh) : lifted(r.k, w1, room - std::sqrt(Z));
    }
    return false;
  }

  // y = z / q scaled onto cone and plane: |y| + g.y = k holds to round-off for every lambda.
  // If q cancels: z / p, which is on the cone.
  static TETHER_INLINE Regime slide(const LocalBlock& L, const LocalRhs& r, double bn, double l,
                                    double* x) {
    const double e0 = L.beta[0] + l, e1 = L.beta[1] + l;
    const double z0 = r.h0 * e1, z1 = r.h1 * e0, z = std::sqrt(z0 * z0 + z1 * z1);
    const double q = z + L.g[0] * z0 + L.g[1] * z1;
    if (std::abs(q) > 0.1 * z) {
      const double i = 1 / q, f = r.k * i;
      from_local(L, bn * L.inv_a * z * i, f * z0, f * z1, x);
    } else {
      const double f = 1 / (e0 * e1);
      from_local(L, f * z / L.mu, f * z0, f * z1, x);
    }
    return Regime::sliding;
  }

  // Both beta replaced by their mean seen along h.
  static TETHER_INLINE double start(const LocalBlock& L, const LocalRhs& r, double hh, double gh) {
    const double weighted = L.beta[0] * r.h0 * r.h0 + L.beta[1] * r.h1 * r.h1;
    const double l = ((std::sqrt(hh) + gh) * hh - r.k * weighted) / (r.k * hh);
    return l > 0 ? l : 0;
  }
  // Larger root of k l^2 + w1 l + c: where w reaches |z| as it is, below the solution as |z| grows.
  static TETHER_INLINE double lifted(double k, double w1, double c) {
    const double D = std::sqrt(w1 * w1 - 4 * k * c);
    return w1 > 0 ? -2 * c / (w1 + D) : (D - w1) / (2 * k);
  }

  // b_n <= 0: f begins negative and falling, and goes on so.
  static inline bool falls(const LocalBlock& L, const LocalRhs& r, double s0, double s1) {
    const double straight = r.k * (L.beta[0] + L.beta[1]) - L.g[0] * r.h0 - L.g[1] * r.h1;
    const double length = std::sqrt(s0 * s0 + s1 * s1);
    return length > 0 && !sticks(L, r, s0, s1, length) &&
           !(straight * length >= s0 * r.h0 + s1 * r.h1);
  }
  // b_n > 0, f(0) >= 0: f rises from there on, so that nothing slides.
  static inline bool rises(const LocalBlock& L, const LocalRhs& r, double s0, double s1) {
    const double straight = r.k * (L.beta[0] + L.beta[1]) - L.g[0] * r.h0 - L.g[1] * r.h1;
    const double length = std::sqrt(s0 * s0 + s1 * s1), d = r.h0 * r.h1 * (L.beta[0] - L.beta[1]);
    return length > 0 && straight * length >= s0 * r.h0 + s1 * r.h1 &&
           (straight * straight >= r.h0 * r.h0 + r.h1 * r.h1 ||
            d * d <= 2 * r.k * length * length * length);
  }
  // b_n > 0, f(0) < 0, f(l) = 0: no other zero. With v = z / |z| at l, f <= k p - (g + v).z, a
  // convex quadratic that is 0 at l, too: if it begins negative nothing precedes l. Nothing follows
  // where f is convex, or where f' = k p' - g.h - z.h / |z| >= k p' - g.h - |h| > 0. room: k p -
  // g.z at 0.
  static TETHER_INLINE bool only(const LocalBlock& L, const LocalRhs& r, double room, double l) {
    const double e0 = L.beta[0] + l, e1 = L.beta[1] + l;
    const double z0 = r.h0 * e1, z1 = r.h1 * e0, zz = z0 * z0 + z1 * z1, z = std::sqrt(zz);
    const double straight = r.k * (e0 + e1) - L.g[0] * r.h0 - L.g[1] * r.h1;
    const double d = r.h0 * r.h1 * (L.beta[0] - L.beta[1]), hh = r.h0 * r.h0 + r.h1 * r.h1;
    const bool first = z * room < z0 * L.beta[1] * r.h0 + z1 * L.beta[0] * r.h1;
    const bool rising = straight * z > z0 * r.h0 + z1 * r.h1;
    return first & rising & ((d * d <= 2 * r.k * zz * z) | (straight * straight >= hh));
  }

  // The same with a second quadratic, v = z / |z| at 0, up to where the first one is negative.
  static bool only_two(const LocalBlock& L, const LocalRhs& r, double room, double l);

  // Newton with a bracket; `warm`, if > 0, and l are where to start. false: it is out of range.
  static bool safeguarded(const LocalBlock& L, const LocalRhs& r, double warm, double& l,
                          int& evaluations);

  // All solutions, exactly; x: the nearest to x.
  static Regime nearest(const LocalBlock& L, const LocalRhs& r, double bn, double* x,
                        double& lambda, int& evaluations);
};

}  // namespace tether::contact::detail
