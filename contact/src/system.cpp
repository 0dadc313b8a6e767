// Tether: sweeps, block solutions and tests of a problem under a law. SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "criterion.hpp"
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
  const double* share;
  const double* inverse_scale;
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

// P_K(x - w - (mu s, s gamma)), s the slip variable.
TETHER_INLINE void natural_point(double mu, double g0, double g1, bool frictionless,
                                 const double* x, const double* w, double* v) {
  if (frictionless) {
    v[0] = x[0] - w[0] > 0 ? x[0] - w[0] : 0;
    v[1] = v[2] = 0;
    return;
  }
  const double s = slip(w[1], w[2], g0, g1);
  v[0] = x[0] - w[0] - mu * s;
  v[1] = x[1] - w[1] - s * g0;
  v[2] = x[2] - w[2] - s * g1;
  project_cone(mu, v);
}

TETHER_CLONES Test natural(const View& s, const PackedVector* x, PackedVector* w, bool dissipation,
                           bool frictionless) {
  double map = 0, xx = 0, ww = 0;
  for (int i = 0; i < s.n; ++i) {
    row(s, x, i, w[i].v);
    const LocalBlock& L = s.local[i];
    const double* xi = x[i].v;
    const double* wi = w[i].v;
    double v[3], g0 = 0, g1 = 0;
    if (dissipation && !(s.rule != nullptr && s.rule[i])) {
      g0 = L.mu * L.inv_a * L.c[0];
      g1 = L.mu * L.inv_a * L.c[1];
    }
    natural_point(L.mu, g0, g1, frictionless, xi, wi, v);
    for (int c = 0; c < 3; ++c) {
      map += (xi[c] - v[c]) * (xi[c] - v[c]);
      xx += xi[c] * xi[c];
      ww += wi[c] * wi[c];
    }
  }
  return {std::sqrt(map), 0, std::sqrt(xx), std::sqrt(ww)};
}

// Largest error of a contact, relative to the velocity scale of its island; infinite if one is not a
// number. The error of a contact: with theta contacts in its row, what |theta D (x_i - z)| is for the
// block solution z of theta D and theta D x_i - w, and how far x_i is outside of the cone, times
// theta A_nn. Solutions do not depend on theta; with it a contact that is given twice, with half the
// impulse each, has the same error. It is at least -w_n: z_n > x_n where w_n < 0.
template <class Rule>
TETHER_INLINE double worst_error(const View& s, const PackedVector* x, bool frictionless) {
  int count = 0;
  double most = 0, sum = 0;
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
    const double reach = frictionless ? 0 : L.mu * xi[0];
    const double t = std::sqrt(xi[1] * xi[1] + xi[2] * xi[2]);
    double outside = t > reach ? t - reach : 0;
    outside = scale * (L.a * (outside > -xi[0] ? outside : -xi[0]));
    double error = std::sqrt(f0 * f0 + f1 * f1 + f2 * f2);
    error = outside > error ? outside : error;
    most = most > error ? most : error;
    sum += error;
  }
  return sum < std::numeric_limits<double>::infinity() ? most
                                                       : std::numeric_limits<double>::infinity();
}
TETHER_CLONES double error_dissipation(const View& s, const PackedVector* x) {
  return worst_error<Dissipation>(s, x, false);
}
TETHER_CLONES double error_mixed(const View& s, const PackedVector* x) {
  return worst_error<MixedRule>(s, x, false);
}
TETHER_CLONES double error_coulomb(const View& s, const PackedVector* x) {
  return worst_error<Classical>(s, x, false);
}
TETHER_CLONES double error_frictionless(const View& s, const PackedVector* x) {
  return worst_error<Smooth>(s, x, true);
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
          weight,             proximal.tau,         proximal.anchor,    nullptr,
          nullptr};
}

}  // namespace

// Arrays of whole PackedVectors: lengths are multiples of 4, storage is aligned.
double dot(const double* p, const double* q, int n) { return dot_kernel(p, q, n); }
void axpy(double a, const double* p, double* q, int n) { axpy_kernel(a, p, q, n); }

// Powers of two that bring the largest trace of a block and the largest component of b near 1, if they
// are out of the ordinary in an island: of the whole problem, or where that does not do of each
// island. Sums and products then round as in ordinary units.
void System::choose_units(const Problem& given) {
  problem_ = &given;
  mass_.clear();
  speed_.clear();
  largest_.clear();
  for (int i = 0; i < given.contacts(); ++i) {
    const std::size_t k = at(given.islands()[at(i)]);
    if (k == largest_.size()) largest_.push_back({0, 0});
    auto& [trace, most] = largest_[k];
    trace = std::max(trace, given.local(i).a + given.local(i).T[0] + given.local(i).T[2]);
    for (double v : given.packed_b()[at(i)].v) most = std::max(most, std::abs(v));
  }
  double all[2] = {0, 0};
  for (const auto& each : largest_)
    for (int c = 0; c < 2; ++c) all[c] = std::max(all[c], each[at(c)]);
  const auto serve = [&](double of_A, double of_b) {
    const auto ordinary = [](double v) { return v > kLeastOrdinary && v < kMostOrdinary; };
    for (const auto& [trace, most] : largest_)
      if (!ordinary(trace * of_A) || !(most == 0 || ordinary(most * of_b))) return false;
    return true;
  };
  if (serve(1, 1)) return;
  // Even, so that roots of A, the weights of the contacts, scale exactly.
  const auto exponent = [](double v) { return v > 0 ? -2 * (std::ilogb(v) / 2) : 0; };
  const int mass = exponent(all[0]), speed = exponent(all[1]);
  const bool together = serve(1 / all[0], all[1] > 0 ? 1 / all[1] : 1);
  for (const auto& [trace, most] : largest_) {
    mass_.push_back(together ? mass : exponent(trace));
    speed_.push_back(together ? speed : exponent(most));
  }
  rescaled_ = given.rescaled(mass_, speed_);
  problem_ = &rescaled_;
}

void System::to_own_units(PackedVector* x) const {
  if (mass_.empty()) return;
  for (int i = 0; i < n_; ++i) {
    const std::size_t k = at(problem_->islands()[at(i)]);
    for (double& v : x[i].v) v = std::ldexp(v, speed_[k] - mass_[k]);
  }
}
void System::to_given_units(PackedVector* x) const {
  if (mass_.empty()) return;
  for (int i = 0; i < n_; ++i) {
    const std::size_t k = at(problem_->islands()[at(i)]);
    for (double& v : x[i].v) v = std::ldexp(v, mass_[k] - speed_[k]);
  }
}

void System::reset(const Problem& given, Law law) {
  choose_units(given);
  const Problem& problem = *problem_;
  law_ = law;
  n_ = problem.contacts();
  any_replaced_ = false;
  weight_.resize(at(n_));
  lambda_.assign(at(n_), -1);
  share_.resize(at(n_));
  inverse_scale_.resize(at(n_));
  needed_.clear();
  norm2_.clear();
  double sum = 0;
  for (int i = 0; i < n_; ++i) {
    const LocalBlock& L = problem.local(i);
    const double* b = problem.packed_b()[at(i)].v;
    weight_[at(i)] = std::sqrt((L.a + L.T[0] + L.T[2]) / 3);
    share_[at(i)] = 1.0 / (problem.row_start()[at(i + 1)] - problem.row_start()[at(i)]);
    const int island = problem.islands()[at(i)];
    if (island == static_cast<int>(needed_.size())) {
      needed_.push_back(0);
      norm2_.push_back(0);
    }
    const double bt2 = b[1] * b[1] + b[2] * b[2], bb = b[0] * b[0] + bt2;
    const double needed = needed_change(b[0], std::sqrt(bt2), law == Law::frictionless ? 0 : L.mu,
                                        0.5 * (L.T[0] + L.T[2]) * L.inv_a);
    needed_[at(island)] = std::max(needed_[at(island)], needed);
    norm2_[at(island)] += bb;
    sum += bb;
  }
  for (int i = 0; i < n_; ++i) {
    const int island = problem.islands()[at(i)];
    inverse_scale_[at(i)] = detail::inverse_scale(needed_[at(island)], norm2_[at(island)]);
  }
  norm_b_ = std::sqrt(sum);
  sweeps = 0;
}

void System::belong_to(const System& whole, const int* contacts) {
  for (int i = 0; i < n_; ++i) {
    if (whole.replaced(contacts[i])) replace(i);
    const int unit = mass_.empty() ? 0 : speed_[at(problem_->islands()[at(i)])];
    inverse_scale_[at(i)] = std::ldexp(whole.inverse_scale(contacts[i]), -unit);
  }
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

void velocities(const Problem& problem, const PackedVector* x, PackedVector* w) {
  multiply(view(problem, nullptr, nullptr, nullptr), x, w);
}
void System::velocities(const PackedVector* x, PackedVector* w) const {
  detail::velocities(*problem_, x, w);
}

Test System::natural_map(const PackedVector* x, PackedVector* scratch) {
  if (!mass_.empty()) return natural_map_given(x, scratch);
  const View s = view(*problem_, any_replaced_ ? rule_.data() : nullptr, nullptr, nullptr);
  return natural(s, x, scratch, law_ == Law::maximum_dissipation, law_ == Law::frictionless);
}

Test System::fixed_point(const PackedVector* x) {
  View s = view(*problem_, rule_.data(), lambda_.data(), nullptr);
  s.share = share_.data();
  s.inverse_scale = inverse_scale_.data();
  Test out;
  switch (law_) {
    case Law::maximum_dissipation:
      out.fixed = any_replaced_ ? error_mixed(s, x) : error_dissipation(s, x);
      break;
    case Law::coulomb: out.fixed = error_coulomb(s, x); break;
    case Law::frictionless: out.fixed = error_frictionless(s, x); break;
  }
  return out;
}

// The map hangs on the units, those given are meant. It is homogeneous in x and w together: all is
// divided by what makes the largest of them 1.
Test System::natural_map_given(const PackedVector* x, PackedVector* scratch) {
  const View s = view(*problem_, any_replaced_ ? rule_.data() : nullptr, nullptr, nullptr);
  multiply(s, x, scratch);
  int most = std::numeric_limits<int>::min();
  const auto exponents = [&](int i) {
    const std::size_t k = at(problem_->islands()[at(i)]);
    return std::pair(mass_[k] - speed_[k], -speed_[k]);  // of x and of w
  };
  for (int i = 0; i < n_; ++i)
    for (int c = 0; c < 3; ++c) {
      if (x[i].v[c] != 0) most = std::max(most, exponents(i).first + std::ilogb(x[i].v[c]));
      for (double v : {scratch[i].v[c], problem_->packed_b()[at(i)].v[c]})
        if (v != 0) most = std::max(most, exponents(i).second + std::ilogb(v));
    }
  double map = 0, xx = 0, ww = 0, bb = 0;
  for (int i = 0; i < n_; ++i) {
    const LocalBlock& L = s.local[i];
    double xi[3], wi[3], v[3], gamma[2];
    for (int c = 0; c < 3; ++c) {
      xi[c] = std::ldexp(x[i].v[c], exponents(i).first - most);
      wi[c] = std::ldexp(scratch[i].v[c], exponents(i).second - most);
      const double b = std::ldexp(problem_->packed_b()[at(i)].v[c], exponents(i).second - most);
      bb += b * b;
    }
    this->gamma(i, gamma);
    natural_point(L.mu, gamma[0], gamma[1], law_ == Law::frictionless, xi, wi, v);
    for (int c = 0; c < 3; ++c) {
      map += (xi[c] - v[c]) * (xi[c] - v[c]);
      xx += xi[c] * xi[c];
      ww += wi[c] * wi[c];
    }
  }
  norm_b_ = std::sqrt(bb);  // in the same unit
  return {std::sqrt(map), 0, std::sqrt(xx), std::sqrt(ww)};
}

double System::rounding(const PackedVector* x) const {
  const Problem& p = *problem_;
  double most = 0;
  for (int i = 0; i < n_; ++i) {
    double sum[3] = {0, 0, 0};
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const double* A = p.blocks()[at(k)].column;
      const double* v = x[p.columns()[at(k)]].v;
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) sum[r] += std::abs(A[4 * c + r] * v[c]);
    }
    most = std::max(most, std::max({sum[0], sum[1], sum[2]}) * inverse_scale_[at(i)]);
  }
  return kRoundOff * most;
}

double System::measure(const Test& t, Measure measure) const {
  const auto over = [](double p, double q) { return q > 0 ? p / q : p; };
  switch (measure) {
    case Measure::fixed_point: return t.fixed;
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
