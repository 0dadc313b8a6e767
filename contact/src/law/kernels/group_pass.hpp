// Tether: one pass over contacts of general bodies under a law, four at a time.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "kernels/body_contacts.hpp"
#include "law/interface/local_geometry.hpp"
#include "law/kernels/general_pass.hpp"

#if TETHER_GROUPS
#include "kernels/body_lanes_avx2.hpp"

// The laws are those of the scalar files, with choices instead of branches; what both share is a
// text in the words of law/interface/real.hpp. In a packing the
// regimes of neighbours are hard to predict, and a wrong guess costs more than the arithmetic that
// it saves. Lanes that need the rare parts of a law are solved one by one afterwards.

namespace tether::contact::detail::avx2 {
namespace {

// Four blocks in the frame in which the tangential block is diagonal.
struct LaneBlocks {
  v4 a, inv_a, mu, c0, c1, g0, g1, ee, beta0, beta1;
};

// Tangential impulse y on the cone and the normal one, for lanes that slide; returns the lanes that
// this does not serve.
struct Sliding {
  v4 x0, x1, x2, lambda, rare;
};

// The whole law for the lanes in `mask`.
template <class Rule>
__attribute__((noinline)) void one_by_one(int mask, const GeneralGroup& g, const double* bn,
                                          const double* b0, const double* b1, double (*x)[4],
                                          double* lambda) {
  for (int k = 0; k < 4; ++k) {
    if (!(mask >> k & 1)) continue;
    const LocalBlock L = diagonal_block(g.a[k], g.inv_a[k], g.mu[k], g.c[0][k], g.c[1][k],
                                        g.beta[0][k], g.beta[1][k]);
    double z[3] = {g.x[0][k], g.x[1][k], g.x[2][k]}, l = g.lambda[k];
    int count = 0;
    Rule::solve(L, bn[k], b0[k], b1[k], z, l, count);
    for (int c = 0; c < 3; ++c) x[c][k] = z[c];
    lambda[k] = l;
  }
}

// Impulses that solve the law for the right-hand side b, from the tangential ones x.
struct LaneSolution {
  v4 x0, x1, x2, lambda;
};
template <class Rule, class Lanes>
TETHER_AVX2 LaneSolution solve_lanes(const GeneralGroup& c, const LaneBlocks& L, v4 bn, v4 b0,
                                     v4 b1, v4 x1, v4 x2, v4 lambda) {
  const v4 zero = all(0), touching = less(zero, bn);
  const v4 q = bn * L.inv_a, k = L.mu * q;
  const v4 h0 = b0 - L.c0 * q, h1 = b1 - L.c1 * q;
  const v4 s0 = L.beta1 * h0, s1 = L.beta0 * h1, length = root(s0 * s0 + s1 * s1);
  const v4 det = L.beta0 * L.beta1;
  const v4 sticking = at_most(length + L.g0 * s0 + L.g1 * s1, k * det);
  const v4 sliding = without(touching, sticking);
  const v4 y0 = s0 / det, y1 = s1 / det;
  v4 z0 = (bn - L.c0 * y0 - L.c1 * y1) * L.inv_a, z1 = y0, z2 = y1, l = lambda;
  v4 rare = Lanes::rare(L, h0, h1, touching);
  if (lanes(sliding)) {
    // The other lanes compute, too: on ones, so that they neither divide by zero nor overflow.
    const Sliding r = Lanes::slide(L, or_one(sliding, bn), or_one(sliding, k), or_one(sliding, h0),
                                   or_one(sliding, h1), or_one(sliding, s0), or_one(sliding, s1),
                                   or_one(sliding, length), x1, x2, lambda, sliding);
    z0 = choose(sliding, r.x0, z0);
    z1 = choose(sliding, r.x1, z1);
    z2 = choose(sliding, r.x2, z2);
    l = choose(sliding, r.lambda, l);
    rare = either(rare, both(sliding, r.rare));
  }
  z0 = both(touching, z0);
  z1 = both(touching, z1);
  z2 = both(touching, z2);
  if (lanes(rare)) {
    alignas(32) double rhs[3][4], x[3][4], lambdas[4];
    _mm256_store_pd(rhs[0], bn);
    _mm256_store_pd(rhs[1], b0);
    _mm256_store_pd(rhs[2], b1);
    _mm256_store_pd(x[0], z0);
    _mm256_store_pd(x[1], z1);
    _mm256_store_pd(x[2], z2);
    _mm256_store_pd(lambdas, l);
    one_by_one<Rule>(lanes(rare), c, rhs[0], rhs[1], rhs[2], x, lambdas);
    z0 = load(x[0]);
    z1 = load(x[1]);
    z2 = load(x[2]);
    l = load(lambdas);
  }
  return {z0, z1, z2, l};
}

// The impulse p with the moments q1 on A, and -p, -q2 on B.
TETHER_AVX2 void push(const BodyArrays& s, const GeneralGroup& c, const Vector& p, const Vector& q1,
                      const Vector& q2, Bodies& A, Bodies& B) {
  const BodyInertia *I[4], *J[4];
  for (int j = 0; j < 4; ++j) {
    I[j] = s.inertia + c.first[j];
    J[j] = c.second[j] < 0 ? s.no_inertia : s.inertia + c.second[j];
  }
  const Vector dw = turn(I, q1), dz = turn(J, q2);
  A.v = {A.v.x + A.m * p.x, A.v.y + A.m * p.y, A.v.z + A.m * p.z};
  A.w = {A.w.x + dw.x, A.w.y + dw.y, A.w.z + dw.z};
  B.v = {B.v.x - B.m * p.x, B.v.y - B.m * p.y, B.v.z - B.m * p.z};
  B.w = {B.w.x - dz.x, B.w.y - dz.y, B.w.z - dz.z};
}

template <class Rule, class Lanes, bool kTest>
TETHER_AVX2 Squares pass(const BodyArrays& s, GeneralGroup* begin, GeneralGroup* end,
                         Coupled coupled) {
  Sums sums = {all(0), all(0)};
  for (GeneralGroup* it = begin; it < end; ++it) {
    GeneralGroup& c = *it;
    if (it + 2 < end) fetch<true>(s, it[2]);
    Bodies A, B;
    find(s, c, A, B);
    read(A);
    read(B);
    const Vector n = load(c.n), t = load(c.t), r1 = load(c.r1), r2 = load(c.r2), o = cross(n, t);
    const Vector a1 = cross(A.w, r1), a2 = cross(B.w, r2);
    const Vector u = {A.v.x - B.v.x + a1.x - a2.x, A.v.y - B.v.y + a1.y - a2.y,
                      A.v.z - B.v.z + a1.z - a2.z};
    const v4 share = kTest ? all(1) / widen(coupled + 4 * (it - begin)) : all(1);
    const v4 w0 = share * (dot(u, n) + load(c.bias)), w1 = share * (dot(u, t) + load(c.slip[0])),
             w2 = share * (dot(u, o) + load(c.slip[1]));
    LaneBlocks L;
    L.a = load(c.a);
    L.inv_a = load(c.inv_a);
    L.mu = load(c.mu);
    L.c0 = load(c.c[0]);
    L.c1 = load(c.c[1]);
    const v4 gamma = L.mu * L.inv_a;
    L.g0 = gamma * L.c0;
    L.g1 = gamma * L.c1;
    L.ee = L.g0 * L.g0 + L.g1 * L.g1;
    L.beta0 = load(c.beta[0]);
    L.beta1 = load(c.beta[1]);
    const v4 x0 = load(c.x[0]), x1 = load(c.x[1]), x2 = load(c.x[2]);
    const v4 lambda = share * load(c.lambda);
    // b = D x - w, D with T = diag(beta) + c c'/a
    const v4 dn = L.a * x0 + L.c0 * x1 + L.c1 * x2, f = dn * L.inv_a;
    const v4 bn = dn - w0, b0 = L.c0 * f + L.beta0 * x1 - w1, b1 = L.c1 * f + L.beta1 * x2 - w2;

    const auto [z0, z1, z2, l] = solve_lanes<Rule, Lanes>(c, L, bn, b0, b1, x1, x2, lambda);
    const v4 d0 = z0 - x0, d1 = z1 - x1, d2 = z2 - x2;
    const v4 e0 = L.a * d0 + L.c0 * d1 + L.c1 * d2, ef = e0 * L.inv_a;
    const v4 e1 = L.c0 * ef + L.beta0 * d1, e2 = L.c1 * ef + L.beta1 * d2;
    add(sums, (e0 * e0 + e1 * e1 + e2 * e2) / (share * share));
    if (kTest) continue;
    _mm256_store_pd(c.x[0], z0);
    _mm256_store_pd(c.x[1], z1);
    _mm256_store_pd(c.x[2], z2);
    _mm256_store_pd(c.lambda, l);
    const Vector p = {d0 * n.x + d1 * t.x + d2 * o.x, d0 * n.y + d1 * t.y + d2 * o.y,
                      d0 * n.z + d1 * t.z + d2 * o.z};
    push(s, c, p, cross(r1, p), cross(r2, p), A, B);
    write(A);
    write(B);
  }
  return total(sums);
}

}  // namespace
}  // namespace tether::contact::detail::avx2

#endif
