// Tether: one pass over contacts of general bodies under a law. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cmath>

#include "kernels/body_contacts.hpp"
#include "law/interface/local_geometry.hpp"

namespace tether::contact::detail {
namespace {

// A block in the frame in which its tangential part is diagonal.
TETHER_INLINE LocalBlock diagonal_block(double a, double inv_a, double mu, double c0, double c1,
                                        double beta0, double beta1) {
  LocalBlock L;
  const double gamma = mu * inv_a;
  L.a = a;
  L.inv_a = inv_a;
  L.mu = mu;
  L.c[0] = c0;
  L.c[1] = c1;
  L.g[0] = gamma * c0;
  L.g[1] = gamma * c1;
  L.e = std::sqrt(L.g[0] * L.g[0] + L.g[1] * L.g[1]);
  L.beta[0] = beta0;
  L.beta[1] = beta1;
  L.cosine = 1;
  L.sine = 0;
  L.unique = false;
  return L;
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
    double w1 = u[0] * c.t[0] + u[1] * c.t[1] + u[2] * c.t[2] + c.slip[0];
    double w2 = u[0] * o[0] + u[1] * o[1] + u[2] * o[2] + c.slip[1];
    const double share = kTest ? 1.0 / coupled[it - begin] : 1;
    w0 *= share;
    w1 *= share;
    w2 *= share;
    const LocalBlock L = diagonal_block(c.a, c.inv_a, c.mu, c.c[0], c.c[1], c.beta[0], c.beta[1]);
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

}  // namespace
}  // namespace tether::contact::detail
