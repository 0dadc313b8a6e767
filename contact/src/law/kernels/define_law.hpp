// Tether: instantiates the kernels of a friction law. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include "law/interface/law.hpp"
#include "law/kernels/exact_error.hpp"
#include "law/kernels/general_pass.hpp"
#include "law/kernels/group_pass.hpp"

// Included by the file of each law, which instantiates the kernels with TETHER_ASSEMBLED_KERNELS.

namespace tether::contact::detail {
namespace {

// The law L, and the law Other at contacts that `rule` marks; void: L at every contact.
template <class L, class Other = void>
struct Laws {
  static constexpr bool kFriction = L::kFriction;
  static constexpr bool kMixed = !std::is_void_v<Other>;

  static TETHER_INLINE Regime solve(const char* rule, int i, const LocalBlock& block, double bn,
                                    double b0, double b1, double* x, double& lambda, int& count) {
    if constexpr (kMixed)
      if (rule[i]) return Other::solve(block, bn, b0, b1, x, lambda, count);
    return L::solve(block, bn, b0, b1, x, lambda, count);
  }
  static TETHER_INLINE void derivative(const char* rule, int i, const LocalBlock& block, double bn,
                                       double b0, double b1, const double* x, Regime regime,
                                       LocalDerivative& d) {
    if constexpr (kMixed)
      if (rule[i]) return Other::derivative(block, bn, b0, b1, x, regime, d);
    L::derivative(block, bn, b0, b1, x, regime, d);
  }
  static TETHER_INLINE void natural_point(const char* rule, int i, const LocalBlock& block,
                                          const double* x, const double* w, double* v) {
    if constexpr (kMixed)
      if (rule[i]) return Other::natural_point(block, x, w, v);
    L::natural_point(block, x, w, v);
  }
  static void gamma(const char* rule, int i, const LocalBlock& block, double* out) {
    if constexpr (kMixed)
      if (rule[i]) return Other::gamma(block, out);
    L::gamma(block, out);
  }
};

template <class Rule>
TETHER_INLINE void sweep(const View& s, PackedVector* x) {
  int count = 0;
  alignas(32) double w[4];
  for (int i = 0; i < s.n; ++i) {
    double r[3];
    row(s, x, i, w);
    block_rhs(s, x, i, w, r);
    Rule::solve(s.rule, i, s.local[i], r[0], r[1], r[2], x[i].v, s.lambda[i], count);
  }
}

template <class Rule>
TETHER_INLINE double blocks(const View& s, const PackedVector* x, PackedVector* out,
                            Regime* regimes, LocalDerivative* derivatives) {
  int count = 0;
  double sum = 0;
  alignas(32) double w[4];
  for (int i = 0; i < s.n; ++i) {
    double r[3], z[3] = {x[i].v[0], x[i].v[1], x[i].v[2]};
    row(s, x, i, w);
    block_rhs(s, x, i, w, r);
    const Regime regime =
        Rule::solve(s.rule, i, s.local[i], r[0], r[1], r[2], z, s.lambda[i], count);
    if (regimes) regimes[i] = regime;
    if (derivatives) {
      Rule::derivative(s.rule, i, s.local[i], r[0], r[1], r[2], z, regime, derivatives[i]);
    }
    double f = 0;
    for (int c = 0; c < 3; ++c) f += (z[c] - x[i].v[c]) * (z[c] - x[i].v[c]);
    sum += s.weight[i] * s.weight[i] * f;
    for (int c = 0; c < 3; ++c) out[i].v[c] = z[c];
    out[i].v[3] = 0;
  }
  return std::sqrt(sum);
}

template <class Rule>
TETHER_INLINE Norms natural_map(const View& s, const PackedVector* x, PackedVector* w) {
  double map = 0, xx = 0, ww = 0;
  for (int i = 0; i < s.n; ++i) {
    row(s, x, i, w[i].v);
    const double* xi = x[i].v;
    const double* wi = w[i].v;
    double v[3];
    Rule::natural_point(s.rule, i, s.local[i], xi, wi, v);
    for (int c = 0; c < 3; ++c) {
      map += (xi[c] - v[c]) * (xi[c] - v[c]);
      xx += xi[c] * xi[c];
      ww += wi[c] * wi[c];
    }
  }
  return {std::sqrt(map), std::sqrt(xx), std::sqrt(ww)};
}

// The largest error of a contact, relative to the velocity scale of its island; infinite if one is
// not a number (method, section 3.1). The error of a contact with theta contacts in its row is the
// larger one of |theta D (x_i - z)|, z the block solution for theta D and theta D x_i - w, and
// theta A_nn times the distance of x_i from the cone. `least` has backward_error() instead, where
// that is less. Solutions do not depend on theta; a contact that is given twice has the error of
// one. The error is at least -w_n, since z_n > x_n where w_n < 0.
template <class Rule>
TETHER_INLINE Test worst_error(const View& s, const PackedVector* x) {
  int count = 0;
  double most = 0, least = 0, sum = 0;
  alignas(32) double w[4];
  for (int i = 0; i < s.n; ++i) {
    const LocalBlock& L = s.local[i];
    const double* xi = x[i].v;
    double r[3], z[3] = {xi[0], xi[1], xi[2]};
    row(s, x, i, w);
    for (int c = 0; c < 3; ++c) w[c] *= s.share[i];
    block_rhs(s, x, i, w, r);
    double lambda = s.lambda[i] * s.share[i];
    Rule::solve(s.rule, i, L, r[0], r[1], r[2], z, lambda, count);
    const double d0 = xi[0] - z[0], d1 = xi[1] - z[1], d2 = xi[2] - z[2];
    const double scale = s.inverse_scale[i] / s.share[i];
    const double f0 = scale * (L.a * d0 + L.c[0] * d1 + L.c[1] * d2);
    const double f1 = scale * (L.c[0] * d0 + L.T[0] * d1 + L.T[1] * d2);
    const double f2 = scale * (L.c[1] * d0 + L.T[1] * d1 + L.T[2] * d2);
    const double most_tangential = Rule::kFriction ? L.mu * xi[0] : 0;
    const double t = std::sqrt(xi[1] * xi[1] + xi[2] * xi[2]);
    double outside = t > most_tangential ? t - most_tangential : 0;
    outside = scale * (L.a * (outside > -xi[0] ? outside : -xi[0]));
    double error = std::sqrt(f0 * f0 + f1 * f1 + f2 * f2);
    error = outside > error ? outside : error;
    most = most > error ? most : error;
    sum += error;
    if (error > least) {
      double gamma[2];
      Rule::gamma(s.rule, i, L, gamma);
      double own = scale * backward_error(L, Rule::kFriction ? L.mu : 0, gamma, xi, w);
      own = outside > own ? outside : own;
      own = own < error ? own : error;
      least = least > own ? least : own;
    }
  }
  Test out;
  const bool numbers = sum < std::numeric_limits<double>::infinity();
  out.fixed = numbers ? most : std::numeric_limits<double>::infinity();
  out.least = numbers ? least : std::numeric_limits<double>::infinity();
  return out;
}

// The whole law for one contact: singular blocks included.
template <class L>
TETHER_INLINE Regime solve_block(const LocalBlock& block, const double* b, double* x,
                                 double& lambda, int& evaluations) {
  Regime regime;
  if ((block.null[0] || block.null[1]) &&
      L::solve_singular(block, b[0], b[1], b[2], x, regime, evaluations)) {
    return regime;
  }
  return L::solve(block, b[0], b[1], b[2], x, lambda, evaluations);
}

}  // namespace
}  // namespace tether::contact::detail

// Defines `constexpr AssembledKernels name` of a rule (Laws), built for the machine at
// hand. To be used once for each rule, in an unnamed namespace of tether::contact::detail.
#define TETHER_ASSEMBLED_KERNELS(name, ...)                                                     \
  using name##_rule = __VA_ARGS__;                                                              \
  TETHER_CLONES void name##_sweep(const View& s, PackedVector* x) { sweep<name##_rule>(s, x); } \
  TETHER_CLONES double name##_blocks(const View& s, const PackedVector* x, PackedVector* out,   \
                                     Regime* regimes, LocalDerivative* derivatives) {           \
    return blocks<name##_rule>(s, x, out, regimes, derivatives);                                \
  }                                                                                             \
  TETHER_CLONES Norms name##_natural(const View& s, const PackedVector* x, PackedVector* w) {   \
    return natural_map<name##_rule>(s, x, w);                                                   \
  }                                                                                             \
  TETHER_CLONES Test name##_error(const View& s, const PackedVector* x) {                       \
    return worst_error<name##_rule>(s, x);                                                      \
  }                                                                                             \
  double name##_exact_error(const View& s, const PackedVector* x, double* each) {               \
    return exact_error<name##_rule>(s, x, each);                                                \
  }                                                                                             \
  constexpr AssembledKernels name = {name##_sweep, name##_blocks, name##_natural, name##_error, \
                                     name##_exact_error};

#if TETHER_GROUPS
#define TETHER_GROUP_KERNELS(L, Lanes)                                                         \
  __attribute__((target("avx2,fma"))) Squares group_pass(const BodyArrays& s, GeneralGroup* b, \
                                                         GeneralGroup* e, Coupled c) {         \
    return c ? avx2::pass<L, avx2::Lanes, true>(s, b, e, c)                                    \
             : avx2::pass<L, avx2::Lanes, false>(s, b, e, c);                                  \
  }
#else
#define TETHER_GROUP_KERNELS(L, Lanes) \
  Squares group_pass(const BodyArrays&, GeneralGroup*, GeneralGroup*, Coupled) { return {}; }
#endif

// All kernels of the law L with the lanes Lanes, chosen for the processor, in an unnamed
// namespace of tether::contact::detail.
#define TETHER_LAW_KERNELS(L, Lanes)                                                               \
  TETHER_CLONES Regime solve(const LocalBlock& block, const double* b, double* x, double& lambda,  \
                             int& evaluations) {                                                   \
    return solve_block<L>(block, b, x, lambda, evaluations);                                       \
  }                                                                                                \
  TETHER_CLONES Squares body_sweep(const BodyArrays& s, GeneralContact* b, GeneralContact* e) {    \
    return pass<L, false>(s, b, e, nullptr);                                                       \
  }                                                                                                \
  TETHER_CLONES Squares body_test(const BodyArrays& s, GeneralContact* b, GeneralContact* e,       \
                                  Coupled c) {                                                     \
    return pass<L, true>(s, b, e, c);                                                              \
  }                                                                                                \
  Squares body_pass(const BodyArrays& s, GeneralContact* b, GeneralContact* e, Coupled c) {        \
    return c ? body_test(s, b, e, c) : body_sweep(s, b, e);                                        \
  }                                                                                                \
  TETHER_GROUP_KERNELS(L, Lanes)                                                                   \
  TETHER_ASSEMBLED_KERNELS(plain, Laws<L>)                                                         \
  constexpr LawKernels all_kernels(const LawKernels* replacement, const AssembledKernels* mixed) { \
    return {{L::kLaw, L::kName, L::kFriction},                                                     \
            solve,                                                                                 \
            L::gamma,                                                                              \
            L::natural_point,                                                                      \
            L::tangent,                                                                            \
            plain,                                                                                 \
            body_pass,                                                                             \
            group_pass,                                                                            \
            replacement,                                                                           \
            mixed};                                                                                \
  }
