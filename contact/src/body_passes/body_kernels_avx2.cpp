// Tether: one pass over contacts between bodies, four at a time. SPDX-License-Identifier:
// BSD-3-Clause
#include "body_passes/body_kernels.hpp"

#if TETHER_GROUPS
#include <cmath>

#include "kernels/body_lanes_avx2.hpp"
#include "law/interface/law.hpp"

namespace tether::contact::detail {
namespace avx2 {
namespace {

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
    const Vector n = load(c.n), p = load(c.p), slip = load(c.slip);
    const v4 s1 = load(c.s1), s2 = load(c.s2);
    const v4 share = kTest ? all(1) / widen(coupled + 4 * (it - begin)) : all(1);
    const v4 inv_a = share * load(c.inv_a), inv_t = share * load(c.inv_t);
    const Vector w = {s1 * A.w.x - s2 * B.w.x, s1 * A.w.y - s2 * B.w.y, s1 * A.w.z - s2 * B.w.z};
    const Vector wn = cross(w, n);
    const Vector u = {wn.x + (A.v.x - B.v.x) + slip.x, wn.y + (A.v.y - B.v.y) + slip.y,
                      wn.z + (A.v.z - B.v.z) + slip.z};
    const v4 un = dot(u, n), pn = dot(p, n), xn = most(pn - (un + load(c.bias)) * inv_a, zero);
    const Vector t = {p.x - pn * n.x - (u.x - un * n.x) * inv_t,
                      p.y - pn * n.y - (u.y - un * n.y) * inv_t,
                      p.z - pn * n.z - (u.z - un * n.z) * inv_t};
    const v4 tt = dot(t, t), reach = load(c.mu) * xn;
    const v4 slides = less(reach * reach, tt);
    const v4 scale = choose(slides, reach / root(or_one(slides, tt)), one);
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

__attribute__((target("avx2,fma"))) Squares spheres(const BodyArrays& s, SphereGroup* b,
                                                    SphereGroup* e, Coupled c) {
  return c ? pass<true>(s, b, e, c) : pass<false>(s, b, e, c);
}

}  // namespace
}  // namespace avx2

bool groups_are_served() {
  static const bool served = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return served;
}
Squares pass(const BodyArrays& s, Law law, GeneralGroup* begin, GeneralGroup* end, Coupled c) {
  return kernels(law).group_pass(s, begin, end, c);
}
Squares pass(const BodyArrays& s, Law, SphereGroup* begin, SphereGroup* end, Coupled c) {
  return avx2::spheres(s, begin, end, c);
}

}  // namespace tether::contact::detail

#else

namespace tether::contact::detail {

bool groups_are_served() { return false; }
Squares pass(const BodyArrays&, Law, GeneralGroup*, GeneralGroup*, Coupled) { return {}; }
Squares pass(const BodyArrays&, Law, SphereGroup*, SphereGroup*, Coupled) { return {}; }

}  // namespace tether::contact::detail

#endif
