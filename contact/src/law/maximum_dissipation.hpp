// Tether: Preclik and Ruede's one-contact MPCC (method, eq. 4, 10). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <limits>

#include "law/interface/local_geometry.hpp"
#include "law/interface/real.hpp"
#include <tether/linalg/friction_cone.hpp>

namespace tether::contact::detail {

namespace scalar {
namespace {
#define TETHER_TEXT TETHER_INLINE
#include "law/maximum_dissipation_arc.hpp"
#undef TETHER_TEXT
}  // namespace
}  // namespace scalar

struct LawKernels;

// Sliding minimises the energy on the arc of the conic that sees the unconstrained minimum
// y* = h / beta. With u at angle phi from u0 = y*/|y*| and t = tan(phi/2), the derivative along
// the arc is a quartic in t that is negative at the near and positive at the far end (method,
// eq. 11). Halley with bisection as safeguard on [0, 1], after reflection (root at phi < 0)
// and inversion (root beyond 90 degrees). No trigonometric function is called.
struct MaximumDissipation {
  static constexpr Law kLaw = Law::maximum_dissipation;
  static constexpr const char* kName = "maximum_dissipation";
  static constexpr bool kFriction = true;
  static const LawKernels kKernels;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double b0, double b1, double* x,
                                    double& /*lambda*/, int& evaluations) {
    if (!(bn > 0)) return separate(x);
    if (L.mu == 0) {
      x[0] = bn * L.inv_a;
      x[1] = x[2] = 0;
      return Regime::sliding;
    }
    const LocalRhs r = to_local(L, bn, b0, b1);
    const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;  // |B| y*
    const double length = std::sqrt(s0 * s0 + s1 * s1);
    if (sticks(L, r, s0, s1, length)) return stick(L, r, bn, x);

    if (!((length > 1e-140) & (length < 1e140)))
      return in_other_units(L, bn, b0, b1, x, evaluations);
    const double w0 = L.cosine * x[1] + L.sine * x[2], w1 = L.cosine * x[2] - L.sine * x[1];
    const scalar::Arc arc = scalar::visible_arc(r.k, L.beta[0], L.beta[1], L.g[0], L.g[1], r.h0,
                                                r.h1, s0, s1, length, L.e >= 1, w0, w1, true);
    if (arc.wide) ++evaluations;
    const double q0 = arc.q0, q1 = arc.q1, q2 = arc.q2, q3 = arc.q3, q4 = arc.q4;
    double lo = arc.lo, hi = arc.hi, t = arc.t;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      ++evaluations;
      const double f = (((q4 * t + q3) * t + q2) * t + q1) * t + q0;
      const double d = ((4 * q4 * t + 3 * q3) * t + 2 * q2) * t + q1;
      if (f < 0) {
        lo = t;
      } else {
        hi = t;
      }
      // Halley's step where it is one, else Newton's.
      const double fs = f * ((6 * q4 * t + 3 * q3) * t + q2), dd = d * d;
      const bool halley = fs < 0.5 * dd;
      const double step = halley ? -f * d / (dd - fs) : -f / d;
      double next = t + step;
      // A Halley step leaves the cube of itself, a Newton step its square.
      if (d > 0) {
        const double size = std::abs(step);
        if ((size <= 1e-5 * t && std::abs(fs) <= 1e-5 * dd) || size <= 1e-8 * t || size <= 1e-12) {
          t = next < lo ? lo : (next > hi ? hi : next);
          break;
        }
      }
      if (!(next > lo && next < hi) || !(d > 0)) next = 0.5 * (lo + hi);
      if (next == t || hi - lo <= 4e-17) break;
      t = next;
    }
    const auto [v0, v1] = scalar::direction(arc, t);
    double denominator = 1 + L.g[0] * v0 + L.g[1] * v1;
    const double floor = 1e-16 * (1 + L.e);
    if (denominator < floor) denominator = floor;
    const double radius = r.k / denominator;
    const double opening = L.e * L.e - 1;
    if (opening > 0 && denominator < 1e-3 * opening) {
      return near_asymptote(L, r, radius * v0, radius * v1, x);
    }
    from_local(L, bn * L.inv_a / denominator, radius * v0, radius * v1, x);
    return Regime::sliding;
  }

  // Far out on a hyperbola the angle says little about the radius. There y = c0 + p s + q / s,
  // s >= 1, with p and q along the asymptotes, and dE/ds is almost linear (method, section 2.3).
  static Regime near_asymptote(const LocalBlock& L, const LocalRhs& r, double y0, double y1,
                               double* x);

  // Solves in other units, in which |B| y* squared stays in the range of doubles.
  static Regime in_other_units(const LocalBlock& L, double bn, double b0, double b1, double* x,
                               int& evaluations);

  // Singular block: where b lies in the range, E does not depend on the null direction, and the
  // admissible point of least |y| that minimises it is taken. (solve() weighs the null direction
  // with the raised beta; |y| may be so large that this costs energy.) false: not such a case.
  static bool solve_singular(const LocalBlock& L, double bn, double b0, double b1, double* x,
                             Regime& regime, int& evaluations);

  static TETHER_INLINE void gamma(const LocalBlock& L, double* out) {
    out[0] = L.mu * L.inv_a * L.c[0];
    out[1] = L.mu * L.inv_a * L.c[1];
  }
  static TETHER_INLINE void natural_point(const LocalBlock& L, const double* x, const double* w,
                                          double* v) {
    double g[2];
    gamma(L, g);
    cone_natural_point(L.mu, g[0], g[1], x, w, v);
  }
  // At (D x)_n = 0, D the contact's own block, the solution jumps where e > 1.
  static void tangent(const LocalBlock& L, const double* x, const double* w, LawTangent& out) {
    double g[2];
    gamma(L, g);
    cone_tangent(L, g, x, w, out);
    if (out.regime != Regime::separating)
      out.nearer(L.a * x[0] + L.c[0] * x[1] + L.c[1] * x[2], Regime::separating);
  }
  static void derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                         Regime regime, LocalDerivative& out);
};

}  // namespace tether::contact::detail
