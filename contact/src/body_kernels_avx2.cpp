// Tether: one pass over contacts between bodies, four at a time. SPDX-License-Identifier:
// BSD-3-Clause
#include "body_kernels.hpp"

#if TETHER_GROUPS
#include <cmath>

#include "body_lanes_avx2.hpp"
#include "law_coulomb.hpp"
#include "law_maximum_dissipation.hpp"

// The laws are those of law_*.hpp, with choices instead of branches: in a packing the regimes of
// neighbours are hard to predict, and a wrong guess costs more than the arithmetic that it saves.
// Lanes that need the rare parts of a law are solved one by one afterwards.

namespace tether::contact::detail {
namespace {

// Four blocks in the frame in which the tangential block is diagonal.
struct Blocks {
  v4 a, inv_a, mu, c0, c1, g0, g1, ee, beta0, beta1;
};

// The whole law for the lanes in `mask`.
template <class Rule>
__attribute__((noinline)) void one_by_one(int mask, const GeneralGroup& g, const double* bn,
                                          const double* b0, const double* b1, double (*x)[4],
                                          double* lambda) {
  for (int k = 0; k < 4; ++k) {
    if (!(mask >> k & 1)) continue;
    LocalBlock L;
    const double gamma = g.mu[k] * g.inv_a[k];
    L.a = g.a[k];
    L.inv_a = g.inv_a[k];
    L.mu = g.mu[k];
    L.c[0] = g.c[0][k];
    L.c[1] = g.c[1][k];
    L.g[0] = gamma * L.c[0];
    L.g[1] = gamma * L.c[1];
    L.e = std::sqrt(L.g[0] * L.g[0] + L.g[1] * L.g[1]);
    L.beta[0] = g.beta[0][k];
    L.beta[1] = g.beta[1][k];
    L.cosine = 1;
    L.sine = 0;
    L.unique = false;
    double z[3] = {g.x[0][k], g.x[1][k], g.x[2][k]}, l = g.lambda[k];
    int count = 0;
    Rule::solve(L, bn[k], b0[k], b1[k], z, l, count);
    for (int c = 0; c < 3; ++c) x[c][k] = z[c];
    lambda[k] = l;
  }
}

// Tangential impulse y on the cone and the normal one, for lanes that slide; returns the lanes that
// this does not serve.
struct Sliding {
  v4 x0, x1, x2, lambda, rare;
};

TETHER_AVX2 Sliding slide(MaximumDissipation, const Blocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4 s0,
                          v4 s1, v4 length, v4 w0, v4 w1, v4 lambda, v4 wanted) {
  const v4 zero = all(0), one = all(1);
  const v4 il = one / length, u0 = s0 * il, u1 = s1 * il;
  const v4 kappa = (k * L.beta0 * L.beta1 - L.g0 * s0 - L.g1 * s1) * il;
  const v4 p1 = u0 * h0 + u1 * h1, p2 = u0 * h1 - u1 * h0;
  const v4 g1 = u0 * L.g0 + u1 * L.g1;
  v4 g2 = u0 * L.g1 - u1 * L.g0;
  const v4 kb0 = k * L.beta0, kb1 = k * L.beta1;
  const v4 B12 = u0 * u1 * (kb1 - kb0);
  const v4 M11 = kb0 * u0 * u0 + kb1 * u1 * u1 - p1 * g1, M12 = B12 - p1 * g2;
  const v4 M21 = B12 - p2 * g1, M22 = kb0 * u1 * u1 + kb1 * u0 * u0 - p2 * g2;
  const v4 S = p1 + M22 * g1 - M12 * g2, C = M21 * g1 - M11 * g2 - p2;
  const v4 K = p1 * g2 - p2 * g1, dM = M22 - M11;
  v4 q0 = M21 + C + K, q1 = 2.0 * (S + dM), q2 = 2.0 * (K - M21) - 4.0 * M12, q3 = 2.0 * (S - dM);
  v4 q4 = M21 - C + K;
  const v4 side = choose(less(zero, q0), -one, one);
  q0 = q0 * side;
  q2 = q2 * side;
  q4 = q4 * side;
  g2 = g2 * side;
  v4 far = root(least((one - kappa) / (one + kappa), all(1e300)));
  far = choose(less(all(-1), kappa), far, all(1e150));
  const v4 open = at_most(one, L.ee);
  if (lanes(both(open, wanted))) {  // before the asymptote
    const v4 A = one - g1, D = g2 * g2 - A * (one + g1), r = root(most(D, zero));
    const v4 cut = choose(less(g2, zero), (one + g1) / (r - g2),
                          choose(less(A, zero), -(g2 + r) / A, all(-1)));
    const v4 use = both(both(open, at_most(zero, D)), both(less(zero, cut), less(cut, far)));
    far = choose(use, cut, far);
  }
  // Warm start: the direction of the present impulse.
  const v4 w = root(w0 * w0 + w1 * w1), down = w + u0 * w0 + u1 * w1;
  v4 t = choose(less(all(1e-12) * w, down), side * (u0 * w1 - u1 * w0) / down, zero);
  const v4 inverted = both(less(one, far), less(q0 + q1 + q2 + q3 + q4, zero));
  v4 lo = zero, hi = least(far, one);
  if (lanes(both(inverted, wanted))) {
    const v4 r0 = q0, r1 = q1;
    q0 = choose(inverted, -q4, q0);
    q1 = choose(inverted, -q3, q1);
    q2 = choose(inverted, -q2, q2);
    q3 = choose(inverted, -r1, q3);
    q4 = choose(inverted, -r0, q4);
    lo = choose(inverted, one / far, lo);
    hi = choose(inverted, one, hi);
    t = choose(inverted, choose(less(zero, t), one / t, one), t);
  }
  t = least(most(t, lo), hi);
  const v4 d1 = 2.0 * q2, d2 = 3.0 * q3, d3 = 4.0 * q4;
  v4 active = wanted;
  for (int n = 0; n < MaximumDissipation::kMaxEvaluations; ++n) {
    const v4 f = (((q4 * t + q3) * t + q2) * t + q1) * t + q0;
    const v4 d = ((d3 * t + d2) * t + d1) * t + q1;
    const v4 below = less(f, zero);
    lo = choose(below, t, lo);
    hi = choose(below, hi, t);
    const v4 step = -f / d, rising = less(zero, d), length_ = size(step);
    v4 next = t + step;
    const v4 small = both(at_most(length_, all(1e-8)), rising);
    const v4 inside = both(both(less(lo, next), less(next, hi)), rising);
    const v4 middle = 0.5 * (lo + hi);
    const v4 careful = choose(inside, next, middle);
    next = choose(small, least(most(next, lo), hi), careful);
    const v4 done =
        choose(small, at_most(length_, most(all(1e-8) * next, all(1e-12))),
               either(_mm256_cmp_pd(next, t, _CMP_EQ_OQ), at_most(hi - lo, all(4e-17))));
    t = choose(active, next, t);
    active = without(active, done);
    if (!lanes(active)) break;
  }
  v4 co = one - t * t, si = 2.0 * t * side;
  co = choose(inverted, -co, co);
  const v4 in = one / (one + t * t);
  co = co * in;
  si = si * in;
  const v4 v0 = co * u0 - si * u1, v1 = co * u1 + si * u0;
  const v4 denominator = most(one + L.g0 * v0 + L.g1 * v1, all(1e-16) * (one + L.ee));
  const v4 opening = L.ee - one;
  const v4 id = one / denominator, radius = k * id;
  return {bn * L.inv_a * id, radius * v0, radius * v1, lambda,
          either(either(at_most(length, all(1e-140)), at_most(all(1e140), length)),
                 both(less(zero, opening), less(denominator, all(1e-3) * opening)))};
}

TETHER_AVX2 Sliding slide(Coulomb, const Blocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4, v4, v4, v4, v4,
                          v4 lambda, v4 wanted) {
  const v4 zero = all(0);
  // A tenth of the range in which several solutions may exist is left to the whole law.
  v4 rare = both(less(all(Coulomb::kManyBranches * Coulomb::kManyBranches), L.ee),
                 either(less(L.g0 * h0, zero), less(L.g1 * h1, zero)));
  const v4 h = root(h0 * h0 + h1 * h1), ik = all(1) / k, e = root(L.ee);
  const v4 beta_min = least(L.beta0, L.beta1), beta_max = most(L.beta0, L.beta1);
  rare = either(rare, at_most(all(1e60) * beta_max, h * ik));
  wanted = without(wanted, rare);
  v4 lo = most((all(1) - e) * h * ik - beta_max, zero);
  v4 hi = most((all(1) + e) * h * ik - beta_min, lo);
  const v4 gh = L.g0 * h0 + L.g1 * h1;
  const v4 mean = (L.beta0 * h0 * h0 + L.beta1 * h1 * h1) / (h * h);
  const v4 guess = least(most((h + gh) * ik - mean, lo), hi);
  v4 l = choose(both(less(lo, lambda), less(lambda, hi)), lambda, guess);
  const v4 stop = choose(less(beta_max, all(1e3) * beta_min), all(3e-8), all(1e-12));
  v4 active = wanted;
  for (int n = 0; n < Coulomb::kMaxEvaluations; ++n) {
    const v4 e0 = L.beta0 + l, e1 = L.beta1 + l, p = e0 * e1;
    const v4 z0 = h0 * e1, z1 = h1 * e0, z = root(z0 * z0 + z1 * z1);
    const v4 q = z + L.g0 * z0 + L.g1 * z1;
    const v4 excess = q - k * p;
    const v4 slope = (e0 + e1) * q * z - p * (z0 * h0 + z1 * h1 + z * gh);
    const v4 step = excess * q * z / (k * slope);
    const v4 above = less(zero, excess), rising = less(zero, slope);
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

struct Sums {
  v4 sum, most;
};
TETHER_AVX2 void add(Sums& s, v4 square) {
  s.sum = s.sum + square;
  s.most = most(square, s.most);
}
TETHER_AVX2 Squares total(const Sums& s) {
  const double pair = s.most[0] > s.most[1] ? s.most[0] : s.most[1];
  const double other = s.most[2] > s.most[3] ? s.most[2] : s.most[3];
  return {(s.sum[0] + s.sum[1]) + (s.sum[2] + s.sum[3]), pair > other ? pair : other};
}

template <class Rule, bool kTest>
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
    const v4 w0 = share * (dot(u, n) + load(c.bias)), w1 = share * dot(u, t), w2 = share * dot(u, o);
    Blocks L;
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

    const v4 zero = all(0), touching = less(zero, bn);
    const v4 q = bn * L.inv_a, k = L.mu * q;
    const v4 h0 = b0 - L.c0 * q, h1 = b1 - L.c1 * q;
    const v4 s0 = L.beta1 * h0, s1 = L.beta0 * h1, length = root(s0 * s0 + s1 * s1);
    const v4 det = L.beta0 * L.beta1;
    const v4 sticking = at_most(length + L.g0 * s0 + L.g1 * s1, k * det);
    const v4 sliding = without(touching, sticking);
    const v4 y0 = s0 / det, y1 = s1 / det;
    v4 z0 = (bn - L.c0 * y0 - L.c1 * y1) * L.inv_a, z1 = y0, z2 = y1, l = lambda;
    v4 rare = zero;
    if (Rule::kLaw == Law::coulomb) {
      // Several solutions are possible: also a stick or a jam at b_n <= 0.
      const v4 many = less(all(Coulomb::kManyBranches * Coulomb::kManyBranches), L.ee);
      const v4 mixed = either(less(L.g0 * h0, zero), less(L.g1 * h1, zero));
      rare = both(both(many, mixed), either(touching, at_most(all(1), L.ee)));
    }
    if (lanes(sliding)) {
      const Sliding r = slide(Rule(), L, bn, k, h0, h1, s0, s1, length, x1, x2, lambda, sliding);
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
    const BodyInertia *I[4], *J[4];
    for (int j = 0; j < 4; ++j) {
      I[j] = s.inertia + c.first[j];
      J[j] = c.second[j] < 0 ? s.no_inertia : s.inertia + c.second[j];
    }
    const Vector dw = turn(I, cross(r1, p)), dz = turn(J, cross(r2, p));
    A.v = {A.v.x + A.m * p.x, A.v.y + A.m * p.y, A.v.z + A.m * p.z};
    A.w = {A.w.x + dw.x, A.w.y + dw.y, A.w.z + dw.z};
    B.v = {B.v.x - B.m * p.x, B.v.y - B.m * p.y, B.v.z - B.m * p.z};
    B.w = {B.w.x - dz.x, B.w.y - dz.y, B.w.z - dz.z};
    write(A);
    write(B);
  }
  return total(sums);
}

template <bool kTest>
TETHER_AVX2 Squares pass(const BodyArrays& s, SphereGroup* begin, SphereGroup* end,
                         Coupled coupled) {
  Sums sums = {all(0), all(0)};
  const v4 zero = all(0), one = all(1);
  for (SphereGroup* it = begin; it < end; ++it) {
    SphereGroup& c = *it;
    if (it + 2 < end) fetch<false>(s, it[2]);
    Bodies A, B;
    find(s, c, A, B);
    read(A);
    read(B);
    const Vector n = load(c.n), p = load(c.p);
    const v4 s1 = load(c.s1), s2 = load(c.s2);
    const v4 share = kTest ? all(1) / widen(coupled + 4 * (it - begin)) : all(1);
    const v4 inv_a = share * load(c.inv_a), inv_t = share * load(c.inv_t);
    const Vector w = {s1 * A.w.x - s2 * B.w.x, s1 * A.w.y - s2 * B.w.y, s1 * A.w.z - s2 * B.w.z};
    const Vector wn = cross(w, n);
    const Vector u = {wn.x + (A.v.x - B.v.x), wn.y + (A.v.y - B.v.y), wn.z + (A.v.z - B.v.z)};
    const v4 un = dot(u, n), pn = dot(p, n), xn = most(pn - (un + load(c.bias)) * inv_a, zero);
    const Vector t = {p.x - pn * n.x - (u.x - un * n.x) * inv_t,
                      p.y - pn * n.y - (u.y - un * n.y) * inv_t,
                      p.z - pn * n.z - (u.z - un * n.z) * inv_t};
    const v4 tt = dot(t, t), reach = load(c.mu) * xn;
    const v4 scale = choose(less(reach * reach, tt), reach / root(tt), one);
    const Vector d = {xn * n.x + scale * t.x - p.x, xn * n.y + scale * t.y - p.y,
                      xn * n.z + scale * t.z - p.z};
    const v4 dn = dot(d, n), dd = dot(d, d);
    add(sums, dn * dn / (inv_a * inv_a) + (dd - dn * dn) / (inv_t * inv_t));
    if (kTest) continue;
    _mm256_store_pd(c.p[0], p.x + d.x);
    _mm256_store_pd(c.p[1], p.y + d.y);
    _mm256_store_pd(c.p[2], p.z + d.z);
    const Vector q = cross(n, d);
    const v4 i1 = A.i * s1, i2 = B.i * s2;
    A.v = {A.v.x + A.m * d.x, A.v.y + A.m * d.y, A.v.z + A.m * d.z};
    A.w = {A.w.x + i1 * q.x, A.w.y + i1 * q.y, A.w.z + i1 * q.z};
    B.v = {B.v.x - B.m * d.x, B.v.y - B.m * d.y, B.v.z - B.m * d.z};
    B.w = {B.w.x - i2 * q.x, B.w.y - i2 * q.y, B.w.z - i2 * q.z};
    write(A);
    write(B);
  }
  return total(sums);
}

#define TETHER_PASS __attribute__((target("avx2,fma"))) Squares
TETHER_PASS dissipation(const BodyArrays& s, GeneralGroup* b, GeneralGroup* e, Coupled c) {
  return c ? pass<MaximumDissipation, true>(s, b, e, c)
           : pass<MaximumDissipation, false>(s, b, e, c);
}
TETHER_PASS coulomb(const BodyArrays& s, GeneralGroup* b, GeneralGroup* e, Coupled c) {
  return c ? pass<Coulomb, true>(s, b, e, c) : pass<Coulomb, false>(s, b, e, c);
}
TETHER_PASS spheres(const BodyArrays& s, SphereGroup* b, SphereGroup* e, Coupled c) {
  return c ? pass<true>(s, b, e, c) : pass<false>(s, b, e, c);
}

}  // namespace

bool groups_are_served() {
  static const bool served = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return served;
}
Squares sweep(const BodyArrays& s, Law law, GeneralGroup* begin, GeneralGroup* end) {
  return law == Law::coulomb ? coulomb(s, begin, end, nullptr) : dissipation(s, begin, end, nullptr);
}
Squares test(const BodyArrays& s, Law law, GeneralGroup* begin, GeneralGroup* end, Coupled c) {
  return law == Law::coulomb ? coulomb(s, begin, end, c) : dissipation(s, begin, end, c);
}
Squares sweep(const BodyArrays& s, Law, SphereGroup* begin, SphereGroup* end) {
  return spheres(s, begin, end, nullptr);
}
Squares test(const BodyArrays& s, Law, SphereGroup* begin, SphereGroup* end, Coupled c) {
  return spheres(s, begin, end, c);
}

}  // namespace tether::contact::detail

#else

namespace tether::contact::detail {

bool groups_are_served() { return false; }
Squares sweep(const BodyArrays&, Law, GeneralGroup*, GeneralGroup*) { return {}; }
Squares test(const BodyArrays&, Law, GeneralGroup*, GeneralGroup*, Coupled) { return {}; }
Squares sweep(const BodyArrays&, Law, SphereGroup*, SphereGroup*) { return {}; }
Squares test(const BodyArrays&, Law, SphereGroup*, SphereGroup*, Coupled) { return {}; }

}  // namespace tether::contact::detail

#endif
