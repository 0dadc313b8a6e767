// Tether: contacts between bodies as the sweeps see them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/one_contact.hpp>
#include <tether/linalg/vector_code.hpp>

// Vector code for four contacts at a time, chosen when the program runs. -DTETHER_GROUPS=0: none.

#ifndef TETHER_GROUPS
#if defined(__GNUC__) && defined(__x86_64__)
#define TETHER_GROUPS 1
#else
#define TETHER_GROUPS 0
#endif
#endif

namespace tether::contact::detail {

// One cache line each. Spheres need only the first.
struct alignas(64) BodyState {
  double v[3], m, w[3],
      i;  // velocity, 1/mass, angular velocity, 1/inertia if that is a multiple of 1
};
struct alignas(64) BodyInertia {
  double xx, xy, xz, yy, yz, zz, pad[2];  // inverse, world axes
};

// `first` always moves; second < 0: body -1 - second of those that do not.
// Tangents such that the tangential block is diagonal: no rotation in the sweep.
struct GeneralContact {
  int first, second;
  double n[3], t[3], r1[3], r2[3];
  double a, inv_a, mu, c[2], beta[2];
  double bias, slip[2], x[3], lambda;
};
static_assert(sizeof(GeneralContact) == 216, "memory for a contact is a promise (README)");

// Spheres: r1 = s1 n, r2 = s2 n, no coupling. Impulse p in world axes.
struct SphereContact {
  int first, second;
  double n[3], s1, s2, inv_a, inv_t, mu, bias, slip[3], p[3];
};

// No friction: one equation. q = r x n; weight = |D e_n|.
struct SmoothContact {
  int first, second;
  double n[3], q1[3], q2[3], inv_a, weight, bias, x;
};

// Four contacts without a common body that moves.
struct alignas(32) GeneralGroup {
  int first[4], second[4];
  double n[3][4], t[3][4], r1[3][4], r2[3][4];
  double a[4], inv_a[4], mu[4], c[2][4], beta[2][4], bias[4], slip[2][4];
  double x[3][4], lambda[4];
};
struct alignas(32) SphereGroup {
  int first[4], second[4];
  double n[3][4], s1[4], s2[4], inv_a[4], inv_t[4], mu[4], bias[4], slip[3][4], p[3][4];
};
static_assert(sizeof(GeneralGroup) == 4 * sizeof(GeneralContact) &&
                  sizeof(SphereGroup) == 4 * sizeof(SphereContact),
              "a group takes what its contacts take");

struct BodyArrays {
  BodyState* state;
  const BodyInertia* inertia;
  const BodyState* fixed;  // bodies that do not move; the first one is the world
  BodyState* nowhere;      // target of writes to them, one for each thread
  const BodyInertia* no_inertia;
};

// Squared velocities over the contacts of a pass: sum and largest.
struct Squares {
  double sum = 0, most = 0;
};

// theta of each contact (method, section 3).
using Coupled = const float*;

// v += p / m, w += I^-1 q
TETHER_INLINE void push(BodyState& s, const BodyInertia& I, const double* p, const double* q) {
  for (int k = 0; k < 3; ++k) s.v[k] += s.m * p[k];
  s.w[0] += I.xx * q[0] + I.xy * q[1] + I.xz * q[2];
  s.w[1] += I.xy * q[0] + I.yy * q[1] + I.yz * q[2];
  s.w[2] += I.xz * q[0] + I.yz * q[1] + I.zz * q[2];
}

TETHER_INLINE void cross(const double* a, const double* b, double* c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

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

}  // namespace
}  // namespace tether::contact::detail
