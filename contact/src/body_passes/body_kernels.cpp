// Tether: one pass over contacts between bodies. SPDX-License-Identifier: BSD-3-Clause
#include "body_passes/body_kernels.hpp"

#include <cmath>

#include "kernels/body_contacts.hpp"
#include "law/interface/law.hpp"

namespace tether::contact::detail {
namespace {

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
    for (int k = 0; k < 3; ++k) u[k] += A.v[k] - B.v[k] + c.slip[k];
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
// Sweeps and tests apart: one function for both would keep fewer numbers in registers.
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

Squares pass(S s, Law law, GeneralContact* b, GeneralContact* e, Coupled c) {
  return kernels(law).pass(s, b, e, c);
}
Squares pass(S s, Law, SphereContact* b, SphereContact* e, Coupled c) {
  return c ? test_spheres(s, b, e, c) : sweep_spheres(s, b, e);
}
Squares pass(S s, Law, SmoothContact* b, SmoothContact* e, Coupled c) {
  return c ? test_smooth(s, b, e, c) : sweep_smooth(s, b, e);
}

}  // namespace tether::contact::detail
