// Tether: sweeps, block solutions and tests of a problem under a law. SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <algorithm>

#include "law_coulomb.hpp"
#include "law_frictionless.hpp"
#include "law_maximum_dissipation.hpp"

namespace tether::contact::detail {
namespace {

typedef double v4 __attribute__((vector_size(32)));

// maximum_dissipation with the Coulomb rule at marked contacts.
struct MixedRule {
  static TETHER_INLINE Regime solve(const char* rule, int i, const LocalBlock& L, double bn,
                                    double b0, double b1, double* x, double& lambda, int& count) {
    if (rule[i]) return Coulomb::solve(L, bn, b0, b1, x, lambda, count);
    return MaximumDissipation::solve(L, bn, b0, b1, x, lambda, count);
  }
};
template <class L0>
struct PlainRule {
  static TETHER_INLINE Regime solve(const char*, int, const LocalBlock& L, double bn, double b0,
                                    double b1, double* x, double& lambda, int& count) {
    return L0::solve(L, bn, b0, b1, x, lambda, count);
  }
};

struct View {
  int n;
  const int* start;
  const int* columns;
  const PackedBlock* blocks;
  const LocalBlock* local;
  const PackedVector* b;
  const char* rule;
  double* lambda;
  const double* weight;
  double tau;
  const PackedVector* anchor;
};

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

// Right-hand side of the block problem, residual form: D x_i - w_i (README, section 5).
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

template <class Rule, class Derivative>
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
      Derivative::derivative(s.rule, i, s.local[i], r[0], r[1], r[2], z, regime, derivatives[i]);
    }
    double f = 0;
    for (int c = 0; c < 3; ++c) f += (z[c] - x[i].v[c]) * (z[c] - x[i].v[c]);
    sum += s.weight[i] * s.weight[i] * f;
    for (int c = 0; c < 3; ++c) out[i].v[c] = z[c];
    out[i].v[3] = 0;
  }
  return std::sqrt(sum);
}

template <class L0>
struct DerivativeOf {
  static void derivative(const char*, int, const LocalBlock& L, double bn, double b0, double b1,
                         const double* x, Regime regime, LocalDerivative& d) {
    L0::derivative(L, bn, b0, b1, x, regime, d);
  }
};
struct MixedDerivative {
  static void derivative(const char* rule, int i, const LocalBlock& L, double bn, double b0,
                         double b1, const double* x, Regime regime, LocalDerivative& d) {
    if (rule[i]) {
      Coulomb::derivative(L, bn, b0, b1, x, regime, d);
    } else {
      MaximumDissipation::derivative(L, bn, b0, b1, x, regime, d);
    }
  }
};

using Dissipation = PlainRule<MaximumDissipation>;
using Classical = PlainRule<Coulomb>;
using Smooth = PlainRule<Frictionless>;

TETHER_CLONES void sweep_dissipation(const View& s, PackedVector* x) { sweep<Dissipation>(s, x); }
TETHER_CLONES void sweep_mixed(const View& s, PackedVector* x) { sweep<MixedRule>(s, x); }
TETHER_CLONES void sweep_coulomb(const View& s, PackedVector* x) { sweep<Classical>(s, x); }
TETHER_CLONES void sweep_frictionless(const View& s, PackedVector* x) { sweep<Smooth>(s, x); }

TETHER_CLONES double blocks_dissipation(const View& s, const PackedVector* x, PackedVector* out,
                                        Regime* r, LocalDerivative* d) {
  return blocks<Dissipation, DerivativeOf<MaximumDissipation>>(s, x, out, r, d);
}
TETHER_CLONES double blocks_mixed(const View& s, const PackedVector* x, PackedVector* out,
                                  Regime* r, LocalDerivative* d) {
  return blocks<MixedRule, MixedDerivative>(s, x, out, r, d);
}
TETHER_CLONES double blocks_coulomb(const View& s, const PackedVector* x, PackedVector* out,
                                    Regime* r, LocalDerivative* d) {
  return blocks<Classical, DerivativeOf<Coulomb>>(s, x, out, r, d);
}
TETHER_CLONES double blocks_frictionless(const View& s, const PackedVector* x, PackedVector* out,
                                         Regime* r, LocalDerivative* d) {
  return blocks<Smooth, DerivativeOf<Frictionless>>(s, x, out, r, d);
}

TETHER_CLONES void multiply(const View& s, const PackedVector* x, PackedVector* w) {
  for (int i = 0; i < s.n; ++i) row(s, x, i, w[i].v);
}

TETHER_CLONES Test natural(const View& s, const PackedVector* x, PackedVector* w, bool dissipation,
                           bool frictionless) {
  double map = 0, xx = 0, ww = 0;
  for (int i = 0; i < s.n; ++i) {
    row(s, x, i, w[i].v);
    const LocalBlock& L = s.local[i];
    const double* xi = x[i].v;
    const double* wi = w[i].v;
    double v[3], mu = L.mu;
    if (frictionless) {
      mu = 0;
      v[0] = xi[0] - wi[0];
      v[1] = v[2] = 0;
      v[0] = v[0] > 0 ? v[0] : 0;
    } else {
      double g0 = 0, g1 = 0;
      if (dissipation && !(s.rule != nullptr && s.rule[i])) {
        g0 = mu * L.inv_a * L.c[0];
        g1 = mu * L.inv_a * L.c[1];
      }
      const double sl = slip(wi[1], wi[2], g0, g1);
      v[0] = xi[0] - wi[0] - mu * sl;
      v[1] = xi[1] - wi[1] - sl * g0;
      v[2] = xi[2] - wi[2] - sl * g1;
      project_cone(mu, v);
    }
    for (int c = 0; c < 3; ++c) {
      map += (xi[c] - v[c]) * (xi[c] - v[c]);
      xx += xi[c] * xi[c];
      ww += wi[c] * wi[c];
    }
  }
  return {std::sqrt(map), 0, std::sqrt(xx), std::sqrt(ww)};
}

// sum |D_i (x_i - z_i)|^2, z from blocks
TETHER_CLONES double block_distance(const View& s, const PackedVector* x, const PackedVector* z) {
  double sum = 0;
  for (int i = 0; i < s.n; ++i) {
    const LocalBlock& L = s.local[i];
    const double d0 = x[i].v[0] - z[i].v[0], d1 = x[i].v[1] - z[i].v[1], d2 = x[i].v[2] - z[i].v[2];
    const double f0 = L.a * d0 + L.c[0] * d1 + L.c[1] * d2;
    const double f1 = L.c[0] * d0 + L.T[0] * d1 + L.T[1] * d2;
    const double f2 = L.c[1] * d0 + L.T[1] * d1 + L.T[2] * d2;
    sum += f0 * f0 + f1 * f1 + f2 * f2;
  }
  return std::sqrt(sum);
}

TETHER_CLONES double dot_kernel(const double* p, const double* q, int n) {
  v4 sum0 = {0, 0, 0, 0}, sum1 = {0, 0, 0, 0};
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    sum0 += *reinterpret_cast<const v4*>(p + i) * *reinterpret_cast<const v4*>(q + i);
    sum1 += *reinterpret_cast<const v4*>(p + i + 4) * *reinterpret_cast<const v4*>(q + i + 4);
  }
  for (; i + 4 <= n; i += 4)
    sum0 += *reinterpret_cast<const v4*>(p + i) * *reinterpret_cast<const v4*>(q + i);
  sum0 += sum1;
  return (sum0[0] + sum0[1]) + (sum0[2] + sum0[3]);
}

TETHER_CLONES void axpy_kernel(double a, const double* p, double* q, int n) {
  for (int i = 0; i < n; i += 4)
    *reinterpret_cast<v4*>(q + i) += a * *reinterpret_cast<const v4*>(p + i);
}

View view(const Problem& p, const char* rule, double* lambda, const double* weight,
          const Proximal& proximal = {}) {
  return {p.contacts(),       p.row_start().data(), p.columns().data(), p.blocks().data(),
          p.locals().data(),  p.packed_b().data(),  rule,               lambda,
          weight,             proximal.tau,         proximal.anchor};
}

}  // namespace

// Arrays of whole PackedVectors: lengths are multiples of 4, storage is aligned.
double dot(const double* p, const double* q, int n) { return dot_kernel(p, q, n); }
void axpy(double a, const double* p, double* q, int n) { axpy_kernel(a, p, q, n); }

void System::reset(const Problem& problem, Law law) {
  problem_ = &problem;
  law_ = law;
  n_ = problem.contacts();
  any_replaced_ = false;
  weight_.resize(at(n_));
  lambda_.assign(at(n_), -1);
  double sum = 0;
  for (int i = 0; i < n_; ++i) {
    const LocalBlock& L = problem.local(i);
    weight_[at(i)] = std::sqrt((L.a + L.T[0] + L.T[2]) / 3);
    for (int c = 0; c < 3; ++c) sum += problem.packed_b()[at(i)].v[c] * problem.packed_b()[at(i)].v[c];
  }
  norm_b_ = std::sqrt(sum);
  sweeps = 0;
}

void System::replace(int i) {
  if (!any_replaced_) rule_.assign(at(n_), 0);
  any_replaced_ = true;
  rule_[at(i)] = 1;
}

void System::sweep(PackedVector* x, const Proximal& proximal) {
  ++sweeps;
  const View s = view(*problem_, rule_.data(), lambda_.data(), weight_.data(), proximal);
  switch (law_) {
    case Law::maximum_dissipation: return any_replaced_ ? sweep_mixed(s, x) : sweep_dissipation(s, x);
    case Law::coulomb: return sweep_coulomb(s, x);
    case Law::frictionless: return sweep_frictionless(s, x);
  }
}

double System::blocks(const PackedVector* x, PackedVector* out, const Proximal& proximal,
                      Regime* regimes, LocalDerivative* derivatives) {
  const View s = view(*problem_, rule_.data(), lambda_.data(), weight_.data(), proximal);
  switch (law_) {
    case Law::maximum_dissipation:
      return any_replaced_ ? blocks_mixed(s, x, out, regimes, derivatives)
                           : blocks_dissipation(s, x, out, regimes, derivatives);
    case Law::coulomb: return blocks_coulomb(s, x, out, regimes, derivatives);
    case Law::frictionless: return blocks_frictionless(s, x, out, regimes, derivatives);
  }
  return 0;
}

void System::velocities(const PackedVector* x, PackedVector* w) const {
  multiply(view(*problem_, nullptr, nullptr, nullptr), x, w);
}

Test System::natural_map(const PackedVector* x, PackedVector* scratch) {
  const View s = view(*problem_, any_replaced_ ? rule_.data() : nullptr, nullptr, nullptr);
  return natural(s, x, scratch, law_ == Law::maximum_dissipation, law_ == Law::frictionless);
}

Test System::fixed_point(const PackedVector* x, PackedVector* scratch) {
  blocks(x, scratch);
  Test out;
  out.fixed = block_distance(view(*problem_, nullptr, nullptr, nullptr), x, scratch);
  return out;
}

double System::measure(const Test& t, Measure measure) const {
  const auto over = [](double p, double q) { return q > 0 ? p / q : p; };
  switch (measure) {
    case Measure::fixed_point: return over(t.fixed, norm_b_);
    case Measure::natural_map_data: return over(t.natural, norm_b_);
    default: return over(t.natural, std::max({norm_b_, t.x, t.w}));
  }
}

void System::gamma(int i, double* out) const {
  out[0] = out[1] = 0;
  if (law_ != Law::maximum_dissipation || replaced(i)) return;
  const LocalBlock& L = problem_->local(i);
  out[0] = L.mu * L.inv_a * L.c[0];
  out[1] = L.mu * L.inv_a * L.c[1];
}

}  // namespace tether::contact::detail
