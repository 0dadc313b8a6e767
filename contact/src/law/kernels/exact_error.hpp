// Tether: rows of A x - b, and errors of contacts below the round-off of double sums (method,
// section 3.2). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/contact/evaluate.hpp>

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

// With large mass ratios the terms of A x - b nearly cancel. A sum of doubles is off by up to one
// unit u |A| |x| for each of its terms, and so are D x_i - w_i and the block solution; the rounding
// of x itself causes one unit only. Sums here are long doubles, and x_i - z_i is computed as a
// correction, not as a difference of rounded points.

using Wide = long double;

// w = (A x - b)_i
inline void wide_row(const View& s, const PackedVector* x, int i, Wide* w) {
  for (int r = 0; r < 3; ++r) w[r] = -static_cast<Wide>(s.b[i].v[r]);
  for (int k = s.start[i]; k < s.start[i + 1]; ++k) {
    const double* A = s.blocks[k].column;
    const double* v = x[s.columns[k]].v;
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) w[r] += static_cast<Wide>(A[4 * c + r]) * v[c];
  }
}

// out = D v, D the diagonal block
inline void wide_block(const LocalBlock& L, const Wide* v, Wide* out) {
  out[0] = L.a * v[0] + L.c[0] * v[1] + L.c[1] * v[2];
  out[1] = L.c[0] * v[0] + L.T[0] * v[1] + L.T[1] * v[2];
  out[2] = L.c[1] * v[0] + L.T[1] * v[1] + L.T[2] * v[2];
}

// Refines a rounded sliding solution z by Newton's method for
//   (w + D d)_n = 0,  |z_t| = mu z_n,  (w + D d)_t parallel to z_t/|z_t| + gamma,  d = z - x;
// z stays if the correction is not small.
inline void refine_sliding(const LocalBlock& L, const double* gamma, const Wide* w, const Wide* x,
                           Wide* z) {
  constexpr int kRefinements = 2;
  constexpr Wide kSmall = 1e-20L;  // of |z|^2
  for (int step = 0; step < kRefinements; ++step) {
    const Wide d[3] = {z[0] - x[0], z[1] - x[1], z[2] - x[2]};
    Wide v[3];
    wide_block(L, d, v);
    for (int c = 0; c < 3; ++c) v[c] += w[c];
    const Wide t = std::sqrt(z[1] * z[1] + z[2] * z[2]);
    if (!(t > 0)) return;
    const Wide u[2] = {z[1] / t, z[2] / t}, q[2] = {u[0] + gamma[0], u[1] + gamma[1]};
    const Eigen::Matrix<Wide, 3, 1> F(v[0], t - L.mu * z[0], v[1] * q[1] - v[2] * q[0]);
    const Wide along = (v[1] * u[0] + v[2] * u[1]) / t;  // -d/dz_t of v x z_t/|z_t|, across z_t
    Eigen::Matrix<Wide, 3, 3> J;
    J << L.a, L.c[0], L.c[1], -static_cast<Wide>(L.mu), u[0], u[1], L.c[0] * q[1] - L.c[1] * q[0],
        L.T[0] * q[1] - L.T[1] * q[0] - along * u[1], L.T[1] * q[1] - L.T[2] * q[0] + along * u[0];
    Eigen::Map<Eigen::Matrix<Wide, 3, 1>> to(z);
    const Eigen::Matrix<Wide, 3, 1> move = -J.inverse() * F;
    if (!(move.squaredNorm() <= kSmall * to.squaredNorm())) return;
    to += move;
  }
}

// b of the block problem, D x - w. w: times the share of the contact.
inline void wide_rhs(const LocalBlock& L, const Wide* x, const Wide* w, double* b) {
  Wide f[3];
  wide_block(L, x, f);
  for (int c = 0; c < 3; ++c) b[c] = static_cast<double>(f[c] - w[c]);
}

// Backward error: a bound on the smallest change of b for which x is exact in its regime (method,
// section 3.3). Inside the cone it is |w|; with p the point of the cone at the same x_n it is
// |w - D (x - p) - slip against p_t| + |D (x - p)|. It matters at strongly coupled contacts near
// the brink of sliding, or where two sliding solutions merge: there the last bit of b decides
// between distant solutions. Infinite where it does not serve: without friction; for jams (b_n <=
// 0) under a law that has none; and for e below half the bound of uniqueness (method, section 2.4).
template <class Real>
TETHER_INLINE Real backward_error(const LocalBlock& L, double mu, const double* gamma,
                                  const Real* x, const Real* w) {
  const Real none = std::numeric_limits<Real>::infinity();
  const bool may_jam = gamma[0] == 0 && gamma[1] == 0;
  if (!(mu > 0) || !(x[0] >= 0) ||
      !(L.e * (L.beta[0] + L.beta[1]) > std::sqrt(L.beta[0] * L.beta[1])) ||
      !(may_jam || L.a * x[0] + L.c[0] * x[1] + L.c[1] * x[2] - w[0] > 0))
    return none;
  const Real rest = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  const Real t = std::sqrt(x[1] * x[1] + x[2] * x[2]), most = mu * x[0];
  if (!(t > 0)) return rest;
  const Real d[2] = {(1 - most / t) * x[1], (1 - most / t) * x[2]};  // x - p
  const Real f[3] = {L.c[0] * d[0] + L.c[1] * d[1], L.T[0] * d[0] + L.T[1] * d[1],
                     L.T[1] * d[0] + L.T[2] * d[1]};
  const Real v[3] = {w[0] - f[0], w[1] - f[1], w[2] - f[2]};
  const Real q[2] = {x[1] / t + gamma[0], x[2] / t + gamma[1]}, qq = q[0] * q[0] + q[1] * q[1];
  const Real along = qq > 0 ? -(v[1] * q[0] + v[2] * q[1]) / qq : 0, slip = along > 0 ? along : 0;
  const Real e[3] = {v[0], v[1] + slip * q[0], v[2] + slip * q[1]};
  const Real on_cone = std::sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) +
                       std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  return t > most || on_cone < rest ? on_cone : rest;
}

// The error of a contact: the smaller one of |D (x - z)| and the backward error, but at least A_nn
// times the distance of x from its cone. z: block solution in doubles; mu: 0 under a law without
// friction.
inline Wide wide_error(const LocalBlock& L, double mu, const double* gamma, const Wide* x,
                       const Wide* w, const double* z, Regime regime) {
  Wide f[3] = {w[0], w[1], w[2]};
  if (regime != Regime::sticking) {
    Wide end[3] = {z[0], z[1], z[2]};
    if (regime == Regime::sliding && mu > 0) {
      refine_sliding(L, gamma, w, x, end);
    } else if (regime == Regime::sliding) {  // z_t = 0, (w + D (z - x))_n = 0
      end[0] = x[0] + (L.c[0] * x[1] + L.c[1] * x[2] - w[0]) / L.a;
    }
    const Wide d[3] = {x[0] - end[0], x[1] - end[1], x[2] - end[2]};
    wide_block(L, d, f);
  }
  const Wide t = std::sqrt(x[1] * x[1] + x[2] * x[2]);
  const Wide outside = L.a * std::max(t - mu * x[0], -x[0]);
  Wide error = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  if (regime != Regime::sticking) error = std::min(error, backward_error(L, mu, gamma, x, w));
  return std::max(error, outside);
}

// Adds a contact to all residuals but fixed_point and natural_map, which belong to whole problems.
inline void add_residuals(const LocalBlock& L, double mu, const double* gamma, const double* x,
                          const double* w, const double* b, Residuals& r) {
  const double t = std::hypot(x[1], x[2]);
  r.signorini = std::max(r.signorini, std::abs(std::min(L.a * x[0], w[0])));
  r.cone = std::max({r.cone, L.a * (t - mu * x[0]), -L.a * x[0]});
  for (int c = 0; c < 3; ++c) {
    r.dissipation += x[c] * w[c];
    r.energy_change += 0.5 * x[c] * (w[c] - b[c]);
  }
  if (mu == 0 || !(x[0] > 0)) return;
  // Distance of w_t to {0} (strictly inside) or to the ray of the law (on the cone).
  double misfit = std::hypot(w[1], w[2]);
  if (t > 0 && t >= mu * x[0] * (1 - 1e-9)) {
    const double d0 = -(x[1] / t + gamma[0]), d1 = -(x[2] / t + gamma[1]), dd = d0 * d0 + d1 * d1;
    const double s = dd > 0 ? std::max(0.0, (w[1] * d0 + w[2] * d1) / dd) : 0;
    misfit = std::hypot(w[1] - s * d0, w[2] - s * d1);
  }
  r.alignment = std::max(r.alignment, misfit);
}

// worst_error() (define_law.hpp) with long sums. each: receives the errors of all contacts,
// or null.
template <class Rule>
double exact_error(const View& s, const PackedVector* x, double* each) {
  int count = 0;
  Wide most = 0;
  for (int i = 0; i < s.n; ++i) {
    const LocalBlock& L = s.local[i];
    const Wide point[3] = {x[i].v[0], x[i].v[1], x[i].v[2]};
    Wide w[3];
    wide_row(s, x, i, w);
    for (Wide& v : w) v *= s.share[i];
    double b[3], z[3] = {x[i].v[0], x[i].v[1], x[i].v[2]}, gamma[2];
    wide_rhs(L, point, w, b);
    double lambda = s.lambda[i] * s.share[i];
    const Regime regime = Rule::solve(s.rule, i, L, b[0], b[1], b[2], z, lambda, count);
    Rule::gamma(s.rule, i, L, gamma);
    const Wide error = wide_error(L, Rule::kFriction ? L.mu : 0, gamma, point, w, z, regime) *
                       s.inverse_scale[i] / s.share[i];
    if (each != nullptr) each[i] = static_cast<double>(error);
    if (!(error < std::numeric_limits<double>::infinity()))
      return std::numeric_limits<double>::infinity();
    most = std::max(most, error);
  }
  return static_cast<double>(most);
}

}  // namespace
}  // namespace tether::contact::detail
