// Tether: four doubles, vectors and bodies at a time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <immintrin.h>

#include "kernels/body_contacts.hpp"

// For the one file that is compiled for AVX2 function by function: everything is inlined there.
#define TETHER_AVX2 static inline __attribute__((always_inline, target("avx2,fma")))

namespace tether::contact::detail::avx2 {
namespace {

using v4 = __m256d;
// The words of law/interface/real.hpp.
using Real = v4;
using Mask = v4;

TETHER_AVX2 v4 all(double x) { return _mm256_set1_pd(x); }
TETHER_AVX2 v4 load(const double* p) { return _mm256_load_pd(p); }
TETHER_AVX2 v4 widen(const float* p) { return _mm256_cvtps_pd(_mm_loadu_ps(p)); }
TETHER_AVX2 v4 root(v4 x) { return _mm256_sqrt_pd(x); }
TETHER_AVX2 v4 less(v4 a, v4 b) { return _mm256_cmp_pd(a, b, _CMP_LT_OQ); }
TETHER_AVX2 v4 at_most(v4 a, v4 b) { return _mm256_cmp_pd(a, b, _CMP_LE_OQ); }
TETHER_AVX2 v4 both(v4 a, v4 b) { return _mm256_and_pd(a, b); }
TETHER_AVX2 v4 either(v4 a, v4 b) { return _mm256_or_pd(a, b); }
TETHER_AVX2 v4 without(v4 a, v4 b) { return _mm256_andnot_pd(b, a); }  // a and not b
TETHER_AVX2 v4 choose(v4 mask, v4 a, v4 b) { return _mm256_blendv_pd(b, a, mask); }
TETHER_AVX2 v4 or_one(v4 mask, v4 a) { return choose(mask, a, all(1)); }
TETHER_AVX2 v4 least(v4 a, v4 b) { return _mm256_min_pd(a, b); }  // b if one is NaN
TETHER_AVX2 v4 most(v4 a, v4 b) { return _mm256_max_pd(a, b); }
TETHER_AVX2 v4 size(v4 a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }
TETHER_AVX2 int lanes(v4 mask) { return _mm256_movemask_pd(mask); }

struct Vector {
  v4 x, y, z;
};
TETHER_AVX2 Vector load(const double (*p)[4]) { return {load(p[0]), load(p[1]), load(p[2])}; }
TETHER_AVX2 Vector cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
TETHER_AVX2 v4 dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

TETHER_AVX2 void transpose(v4& a, v4& b, v4& c, v4& d) {
  const v4 p = _mm256_unpacklo_pd(a, b), q = _mm256_unpackhi_pd(a, b);
  const v4 r = _mm256_unpacklo_pd(c, d), s = _mm256_unpackhi_pd(c, d);
  a = _mm256_permute2f128_pd(p, r, 0x20);
  b = _mm256_permute2f128_pd(q, s, 0x20);
  c = _mm256_permute2f128_pd(p, r, 0x31);
  d = _mm256_permute2f128_pd(q, s, 0x31);
}

// Four bodies: velocity and 1/m, angular velocity and 1/inertia.
struct Bodies {
  const BodyState* at[4];
  BodyState* to[4];
  Vector v, w;
  v4 m, i;
};
TETHER_AVX2 void read(Bodies& b) {
  v4 p = load(b.at[0]->v), q = load(b.at[1]->v), r = load(b.at[2]->v), s = load(b.at[3]->v);
  transpose(p, q, r, s);
  b.v = {p, q, r};
  b.m = s;
  p = load(b.at[0]->w), q = load(b.at[1]->w), r = load(b.at[2]->w), s = load(b.at[3]->w);
  transpose(p, q, r, s);
  b.w = {p, q, r};
  b.i = s;
}
TETHER_AVX2 void write(const Bodies& b) {
  v4 p = b.v.x, q = b.v.y, r = b.v.z, s = b.m;
  transpose(p, q, r, s);
  _mm256_store_pd(b.to[0]->v, p);
  _mm256_store_pd(b.to[1]->v, q);
  _mm256_store_pd(b.to[2]->v, r);
  _mm256_store_pd(b.to[3]->v, s);
  p = b.w.x, q = b.w.y, r = b.w.z, s = b.i;
  transpose(p, q, r, s);
  _mm256_store_pd(b.to[0]->w, p);
  _mm256_store_pd(b.to[1]->w, q);
  _mm256_store_pd(b.to[2]->w, r);
  _mm256_store_pd(b.to[3]->w, s);
}

template <class Group>
TETHER_AVX2 void find(const BodyArrays& s, const Group& g, Bodies& A, Bodies& B) {
  for (int k = 0; k < 4; ++k) {
    const int b = g.second[k];
    A.at[k] = A.to[k] = s.state + g.first[k];
    B.to[k] = b < 0 ? s.nowhere : s.state + b;
    B.at[k] = b < 0 ? s.fixed - 1 - b : B.to[k];
  }
}

TETHER_AVX2 v4 halves(const double* low, const double* high) {
  return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_load_pd(low)), _mm_load_pd(high), 1);
}

// Bodies of a group to come.
template <bool kInertia, class Group>
TETHER_AVX2 void fetch(const BodyArrays& s, const Group& g) {
  for (int k = 0; k < 4; ++k) {
    const int a = g.first[k], b = g.second[k] < 0 ? a : g.second[k];
    __builtin_prefetch(s.state + a, 1);
    __builtin_prefetch(s.state + b, 1);
    if (!kInertia) continue;
    __builtin_prefetch(s.inertia + a);
    __builtin_prefetch(s.inertia + b);
  }
}

// dw = I^-1 q for four bodies.
TETHER_AVX2 Vector turn(const BodyInertia* const* I, const Vector& q) {
  v4 xx = load(&I[0]->xx), xy = load(&I[1]->xx), xz = load(&I[2]->xx), yy = load(&I[3]->xx);
  transpose(xx, xy, xz, yy);
  const v4 even = halves(&I[0]->yz, &I[2]->yz), odd = halves(&I[1]->yz, &I[3]->yz);
  const v4 yz = _mm256_unpacklo_pd(even, odd), zz = _mm256_unpackhi_pd(even, odd);
  return {xx * q.x + xy * q.y + xz * q.z, xy * q.x + yy * q.y + yz * q.z,
          xz * q.x + yz * q.y + zz * q.z};
}

// Squares of velocities, lane by lane.
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

}  // namespace
}  // namespace tether::contact::detail::avx2
