// Tether: one pass over contacts between bodies. SPDX-License-Identifier: BSD-3-Clause
#include "body_kernels.hpp"

#include <cmath>

#include "law_coulomb.hpp"
#include "law_maximum_dissipation.hpp"

namespace tether::contact::detail {
namespace {

// Bodies of a contact to come; the contacts themselves are read in order.
constexpr int kAhead = 4;

template <class Contact>
TETHER_INLINE void fetch(const BodyArrays& s, const Contact* c, const Contact* end) {
#if defined(__GNUC__)
  if (c + kAhead >= end) return;
  __builtin_prefetch(s.state + c[kAhead].first, 1);
  __builtin_prefetch(s.state + (c[kAhead].second < 0 ? 0 : c[kAhead].second), 1);
#endif
}

template <class Contact>
TETHER_INLINE const BodyState& second(const BodyArrays& s, const Contact& c) {
  return *(c.second < 0 ? s.fixed - 1 - c.second : s.state + c.second);
}

TETHER_INLINE void add(Squares& sum, double square, double share) {
  square /= share * share;
  sum.sum += square;
  sum.most = square > sum.most ? square : sum.most;
}

template <class L0, bool kTest>
TETHER_INLINE Squares pass(const BodyArrays& s, GeneralContact* begin, GeneralContact* end,
                           Coupled coupled) {
  Squares sum;
  int count = 0;
  for (GeneralContact* it = begin; it < end; ++it) {
    GeneralContact& c = *it;
    fetch(s, it, end);
    BodyState& A = s.state[c.first];
    const BodyState& B = second(s, c);
    double u[3], a1[3], a2[3];
    cross(A.w, c.r1, a1);
    cross(B.w, c.r2, a2);
    for (int k = 0; k < 3; ++k) u[k] = A.v[k] - B.v[k] + a1[k] - a2[k];
    double o[3];
    cross(c.n, c.t, o);
    double w0 = u[0] * c.n[0] + u[1] * c.n[1] + u[2] * c.n[2] + c.bias;
    double w1 = u[0] * c.t[0] + u[1] * c.t[1] + u[2] * c.t[2];
    double w2 = u[0] * o[0] + u[1] * o[1] + u[2] * o[2];
    const double share = kTest ? 1.0 / coupled[it - begin] : 1;
    w0 *= share;
    w1 *= share;
    w2 *= share;
    LocalBlock L;
    L.a = c.a;
    L.inv_a = c.inv_a;
    L.mu = c.mu;
    const double gamma = c.mu * c.inv_a;
    L.c[0] = c.c[0];
    L.c[1] = c.c[1];
    L.g[0] = gamma * c.c[0];
    L.g[1] = gamma * c.c[1];
    L.e = std::sqrt(L.g[0] * L.g[0] + L.g[1] * L.g[1]);
    L.beta[0] = c.beta[0];
    L.beta[1] = c.beta[1];
    L.cosine = 1;
    L.sine = 0;
    L.unique = false;
    // D x with T = diag(beta) + c c'/a
    const double cx = c.c[0] * c.x[1] + c.c[1] * c.x[2], dn = c.a * c.x[0] + cx, f = dn * c.inv_a;
    double x[3] = {c.x[0], c.x[1], c.x[2]}, lambda = c.lambda * share;
    L0::solve(L, dn - w0, c.c[0] * f + c.beta[0] * c.x[1] - w1,
              c.c[1] * f + c.beta[1] * c.x[2] - w2, x, lambda, count);
    const double d0 = x[0] - c.x[0], d1 = x[1] - c.x[1], d2 = x[2] - c.x[2];
    const double e0 = c.a * d0 + c.c[0] * d1 + c.c[1] * d2, ef = e0 * c.inv_a;
    const double e1 = c.c[0] * ef + c.beta[0] * d1, e2 = c.c[1] * ef + c.beta[1] * d2;
    add(sum, e0 * e0 + e1 * e1 + e2 * e2, share);
    if (kTest) continue;
    double p[3], q[3];
    for (int k = 0; k < 3; ++k) p[k] = d0 * c.n[k] + d1 * c.t[k] + d2 * o[k];
    c.x[0] = x[0];
    c.x[1] = x[1];
    c.x[2] = x[2];
    c.lambda = lambda;
    cross(c.r1, p, q);
    push(A, s.inertia[c.first], p, q);
    if (c.second < 0) continue;
    for (int k = 0; k < 3; ++k) p[k] = -p[k];
    cross(c.r2, p, q);
    push(s.state[c.second], s.inertia[c.second], p, q);
  }
  return sum;
}

template <bool kTest>
TETHER_INLINE Squares pass(const BodyArrays& s, SphereContact* begin, SphereContact* end,
                           Coupled coupled) {
  Squares sum;
  for (SphereContact* it = begin; it < end; ++it) {
    SphereContact& c = *it;
    fetch(s, it, end);
    BodyState& A = s.state[c.first];
    const BodyState& B = second(s, c);
    // u = v1 - v2 + (s1 w1 - s2 w2) x n
    double w[3], u[3];
    for (int k = 0; k < 3; ++k) w[k] = c.s1 * A.w[k] - c.s2 * B.w[k];
    cross(w, c.n, u);
    for (int k = 0; k < 3; ++k) u[k] += A.v[k] - B.v[k];
    const double un = u[0] * c.n[0] + u[1] * c.n[1] + u[2] * c.n[2];  // without bias
    const double share = kTest ? 1.0 / coupled[it - begin] : 1;
    const double inv_a = share * c.inv_a, inv_t = share * c.inv_t;
    const double pn = c.p[0] * c.n[0] + c.p[1] * c.n[1] + c.p[2] * c.n[2];
    double xn = pn - (un + c.bias) * inv_a;
    xn = xn > 0 ? xn : 0;
    double t[3], tt = 0;
    for (int k = 0; k < 3; ++k) {
      t[k] = c.p[k] - pn * c.n[k] - (u[k] - un * c.n[k]) * inv_t;
      tt += t[k] * t[k];
    }
    const double most = c.mu * xn;
    const double scale = tt > most * most ? most / std::sqrt(tt) : 1;
    double p[3], dn = 0, dd = 0;
    for (int k = 0; k < 3; ++k) {
      p[k] = xn * c.n[k] + scale * t[k] - c.p[k];
      dn += p[k] * c.n[k];
      dd += p[k] * p[k];
    }
    add(sum, dn * dn / (inv_a * inv_a) + (dd - dn * dn) / (inv_t * inv_t), 1);
    if (kTest) continue;
    double q[3];
    cross(c.n, p, q);
    const double i1 = A.i * c.s1, i2 = B.i * c.s2;
    for (int k = 0; k < 3; ++k) {
      c.p[k] += p[k];
      A.v[k] += A.m * p[k];
      A.w[k] += i1 * q[k];
    }
    if (c.second < 0) continue;
    BodyState& C = s.state[c.second];
    for (int k = 0; k < 3; ++k) {
      C.v[k] -= C.m * p[k];
      C.w[k] -= i2 * q[k];
    }
  }
  return sum;
}

template <bool kTest>
TETHER_INLINE Squares pass(const BodyArrays& s, SmoothContact* begin, SmoothContact* end,
                           Coupled coupled) {
  Squares sum;
  for (SmoothContact* it = begin; it < end; ++it) {
    SmoothContact& c = *it;
    fetch(s, it, end);
    BodyState& A = s.state[c.first];
    const BodyState& B = second(s, c);
    double w = c.bias;
    for (int k = 0; k < 3; ++k) {
      w += (A.v[k] - B.v[k]) * c.n[k] + A.w[k] * c.q1[k] - B.w[k] * c.q2[k];
    }
    const double share = kTest ? 1.0 / coupled[it - begin] : 1;
    double x = c.x - share * w * c.inv_a;
    x = x > 0 ? x : 0;
    const double d = x - c.x, e = d * c.weight;
    add(sum, e * e, share);
    if (kTest) continue;
    c.x = x;
    double p[3], q[3];
    for (int k = 0; k < 3; ++k) {
      p[k] = d * c.n[k];
      q[k] = d * c.q1[k];
    }
    push(A, s.inertia[c.first], p, q);
    if (c.second < 0) continue;
    for (int k = 0; k < 3; ++k) {
      p[k] = -d * c.n[k];
      q[k] = -d * c.q2[k];
    }
    push(s.state[c.second], s.inertia[c.second], p, q);
  }
  return sum;
}

using S = const BodyArrays&;
using G = GeneralContact*;
TETHER_CLONES Squares sweep_dissipation(S s, G b, G e) {
  return pass<MaximumDissipation, false>(s, b, e, nullptr);
}
TETHER_CLONES Squares test_dissipation(S s, G b, G e, Coupled c) {
  return pass<MaximumDissipation, true>(s, b, e, c);
}
TETHER_CLONES Squares sweep_coulomb(S s, G b, G e) { return pass<Coulomb, false>(s, b, e, nullptr); }
TETHER_CLONES Squares test_coulomb(S s, G b, G e, Coupled c) {
  return pass<Coulomb, true>(s, b, e, c);
}
TETHER_CLONES Squares sweep_spheres(S s, SphereContact* b, SphereContact* e) {
  return pass<false>(s, b, e, nullptr);
}
TETHER_CLONES Squares test_spheres(S s, SphereContact* b, SphereContact* e, Coupled c) {
  return pass<true>(s, b, e, c);
}
TETHER_CLONES Squares sweep_smooth(S s, SmoothContact* b, SmoothContact* e) {
  return pass<false>(s, b, e, nullptr);
}
TETHER_CLONES Squares test_smooth(S s, SmoothContact* b, SmoothContact* e, Coupled c) {
  return pass<true>(s, b, e, c);
}

}  // namespace

Squares sweep(S s, Law law, G b, G e) {
  return law == Law::coulomb ? sweep_coulomb(s, b, e) : sweep_dissipation(s, b, e);
}
Squares test(S s, Law law, G b, G e, Coupled c) {
  return law == Law::coulomb ? test_coulomb(s, b, e, c) : test_dissipation(s, b, e, c);
}
Squares sweep(S s, Law, SphereContact* b, SphereContact* e) { return sweep_spheres(s, b, e); }
Squares test(S s, Law, SphereContact* b, SphereContact* e, Coupled c) {
  return test_spheres(s, b, e, c);
}
Squares sweep(S s, Law, SmoothContact* b, SmoothContact* e) { return sweep_smooth(s, b, e); }
Squares test(S s, Law, SmoothContact* b, SmoothContact* e, Coupled c) {
  return test_smooth(s, b, e, c);
}

}  // namespace tether::contact::detail
