// Tether: rows of A x - b and right-hand sides of the block problems. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "law/interface/law.hpp"

namespace tether::contact::detail {
namespace {

typedef double v4 __attribute__((vector_size(32)));

// w = (A x - b)_i
TETHER_INLINE void row(const View& s, const PackedVector* x, int i, double* w) {
  v4 sum0 = -*reinterpret_cast<const v4*>(s.b[i].v), sum1 = {0, 0, 0, 0}, sum2 = {0, 0, 0, 0};
  for (int k = s.start[i]; k < s.start[i + 1]; ++k) {
    const v4* c = reinterpret_cast<const v4*>(s.blocks[k].column);
    const double* xj = x[s.columns[k]].v;
    sum0 += c[0] * xj[0];
    sum1 += c[1] * xj[1];
    sum2 += c[2] * xj[2];
  }
  *reinterpret_cast<v4*>(w) = sum0 + sum1 + sum2;
}

// Right-hand side of the block problem, residual form: D x_i - w_i (method, section 4).
TETHER_INLINE void block_rhs(const View& s, const PackedVector* x, int i, const double* w,
                             double* r) {
  const LocalBlock& L = s.local[i];
  const double x0 = x[i].v[0], x1 = x[i].v[1], x2 = x[i].v[2];
  r[0] = L.a * x0 + L.c[0] * x1 + L.c[1] * x2;
  r[1] = L.c[0] * x0 + L.T[0] * x1 + L.T[1] * x2;
  r[2] = L.c[1] * x0 + L.T[1] * x1 + L.T[2] * x2;
  if (s.anchor == nullptr) {
    r[0] -= w[0];
    r[1] -= w[1];
    r[2] -= w[2];
  } else {
    const double* p = s.anchor[i].v;
    const double d0 = x0 - p[0], d1 = x1 - p[1], d2 = x2 - p[2], f = 1 / (1 + s.tau);
    r[0] -= f * (w[0] + s.tau * (L.a * d0 + L.c[0] * d1 + L.c[1] * d2));
    r[1] -= f * (w[1] + s.tau * (L.c[0] * d0 + L.T[0] * d1 + L.T[1] * d2));
    r[2] -= f * (w[2] + s.tau * (L.c[1] * d0 + L.T[1] * d1 + L.T[2] * d2));
  }
}

}  // namespace
}  // namespace tether::contact::detail
