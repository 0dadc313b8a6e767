// Tether: Coulomb's law: all of its solutions, and kernels. SPDX-License-Identifier: BSD-3-Clause

#include "law/coulomb.hpp"

#include <algorithm>
#include <limits>

#include "law/interface/real.hpp"
#include "law/kernels/define_law.hpp"
#include "law/kernels/group_pass.hpp"

#if TETHER_GROUPS

namespace tether::contact::detail::avx2 {
namespace {

#define TETHER_TEXT TETHER_AVX2
#include "law/coulomb_slip.hpp"
#undef TETHER_TEXT

struct CoulombLanes {
  // Several solutions are possible: also a stick or a jam at b_n <= 0.
  TETHER_AVX2 v4 rare(const LaneBlocks& L, v4 h0, v4 h1, v4 touching) {
    const v4 many = less(all(Coulomb::kManyBranches * Coulomb::kManyBranches), L.ee);
    const v4 mixed = either(less(L.g0 * h0, all(0)), less(L.g1 * h1, all(0)));
    return both(both(many, mixed), either(touching, at_most(all(1), L.ee)));
  }

  TETHER_AVX2 Sliding slide(const LaneBlocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4, v4, v4, v4, v4,
                            v4 lambda, v4 wanted) {
    const v4 zero = all(0);
    // A tenth of the range in which several solutions may exist is left to the whole law.
    v4 rare = both(less(all(Coulomb::kManyBranches * Coulomb::kManyBranches), L.ee),
                   either(less(L.g0 * h0, zero), less(L.g1 * h1, zero)));
    const v4 h = root(h0 * h0 + h1 * h1), e = root(L.ee);
    const v4 beta_min = least(L.beta0, L.beta1), beta_max = most(L.beta0, L.beta1);
    const v4 grazing = at_most(all(1e60) * beta_max * k, h);
    k = choose(grazing, all(1), k);
    const v4 ik = all(1) / k;
    rare = either(rare, grazing);
    wanted = without(wanted, rare);
    auto [lo, hi] = slip_bracket(e, h, ik, beta_min, beta_max);
    const v4 gh = L.g0 * h0 + L.g1 * h1;
    const v4 mean = (L.beta0 * h0 * h0 + L.beta1 * h1 * h1) / most(h * h, all(1e-300));
    const v4 guess = least(most((h + gh) * ik - mean, lo), hi);
    v4 l = choose(both(less(lo, lambda), less(lambda, hi)), lambda, guess);
    const v4 stop = choose(less(beta_max, all(1e3) * beta_min), all(3e-8), all(1e-12));
    v4 active = wanted;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      const SlipEquation f = slip_equation(l, k, L.beta0, L.beta1, L.g0, L.g1, h0, h1, gh);
      const v4 above = less(zero, f.excess), rising = less(zero, k * f.slope);
      const v4 step = f.excess * f.q * f.z / or_one(rising, k * f.slope);
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
};

}  // namespace
}  // namespace tether::contact::detail::avx2

#endif

namespace tether::contact::detail {

namespace scalar {
namespace {
#define TETHER_TEXT TETHER_INLINE
#include "law/coulomb_slip.hpp"
#undef TETHER_TEXT
}  // namespace
}  // namespace scalar

// Not inlined into kernels that are built for several machines: its bits are the same on all.
__attribute__((noinline)) void Coulomb::derivative(const LocalBlock& L, double bn, double b0,
                                                   double b1, const double* x, Regime regime,
                                                   LocalDerivative& out) {
  cone_derivative(L, bn, b0, b1, x, regime, false, out);
}

namespace {

// f = k p - g.z - |z| of the Coulomb law and its derivatives; z = z(0) + lambda h. |z| is convex
// with second derivative d^2 / |z|^3, d = h_0 h_1 (beta_0 - beta_1), and grows, so f'' grows with
// lambda.
struct Secular {
  double k, sum, product, gh, gs, h0, h1, s0, s1, hh, sh, ss, dd;
  int evaluations = 0;
  double f = 0, slope = 0, length = 0;

  Secular(const LocalBlock& L, const LocalRhs& r)
      : k(r.k),
        sum(L.beta[0] + L.beta[1]),
        product(L.beta[0] * L.beta[1]),
        gh(L.g[0] * r.h0 + L.g[1] * r.h1),
        gs(0),
        h0(r.h0),
        h1(r.h1),
        s0(L.beta[1] * r.h0),
        s1(L.beta[0] * r.h1),
        hh(h0 * h0 + h1 * h1),
        sh(s0 * h0 + s1 * h1),
        ss(s0 * s0 + s1 * s1) {
    gs = L.g[0] * s0 + L.g[1] * s1;
    const double d = h0 * h1 * (L.beta[0] - L.beta[1]);
    dd = d * d;
  }
  void at(double l) {
    ++evaluations;
    const double z0 = s0 + l * h0, z1 = s1 + l * h1;
    length = std::sqrt(z0 * z0 + z1 * z1);
    f = k * (product + l * (sum + l)) - gs - l * gh - length;
    slope = k * (sum + 2 * l) - gh - (sh + l * hh) / length;
  }
  double curvature() const { return 2 * k - dd / (length * length * length); }

  // Newton for f = 0 from a point where f and f'' have one sign, or the limit of such a sequence.
  double zero(double l, double least) {
    for (int n = 0; n < 200; ++n) {
      at(l);
      const double step = -f / slope;
      if (!std::isfinite(step)) return l;
      l += step;
      if (std::abs(step) <= 1e-13 * (l + least)) break;
    }
    return l;
  }
  // f' = 0 likewise; stops where `until` (sign of f) is reached.
  double turn(double l, double least, double until) {
    for (int n = 0; n < 100; ++n) {
      at(l);
      if (f * until > 0) break;
      const double step = -slope / curvature();
      if (!std::isfinite(step) || std::abs(step) <= 1e-10 * (l + least)) break;
      l += step;
    }
    return l;
  }
};

// visit(lambda) for the zeros of f beyond 0, and maybe for points that are none; e: at 0.
template <class Visit>
void each_zero(Secular& e, const LocalBlock& L, const LocalRhs& r, double least, bool static_,
               const Visit& slides) {
  const double infinity = std::numeric_limits<double>::infinity();
  const double rise = e.slope;
  // End of the concave part, |z|^3 = d^2 / 2k. At k <= 0 there is no other.
  double bend = infinity;
  if (r.k > 0) {
    const double t = std::cbrt(e.dd / (2 * r.k)), c = t * t - e.ss;
    bend = c > 0 ? c / (e.sh + std::sqrt(e.sh * e.sh + e.hh * c)) : 0;
  }
  // Beyond this f > 0 (k > 0) or f < 0 (k < 0).
  const double h = std::sqrt(e.hh), far = std::max(0.0, (1 + L.e) * h / std::abs(r.k) - least);
  bool positive_at_bend = !static_;
  if (bend > 0) {
    const double end = bend < infinity  ? bend
                       : far < infinity ? 2 * far + least
                                        : 1e15 * (e.sum + 1);  // k = 0: straight in the end
    e.at(end);
    positive_at_bend = e.f >= 0;
    if (static_ && !positive_at_bend) {
      slides(e.zero(end, least));
    } else if (!static_ && positive_at_bend) {
      slides(e.zero(0, least));
    } else if (!static_ && rise > 0 && e.slope < 0) {
      const double top = e.turn(0, least, 1);
      e.at(top);
      if (e.f >= 0) {
        slides(e.zero(0, least));
        slides(e.zero(end, least));
      }
    }
  } else {
    positive_at_bend = static_;
  }
  if (bend < infinity) {
    e.at(bend);
    const double fall = e.slope, from = std::max(far, bend);
    if (!positive_at_bend) {
      slides(e.zero(from + least, least));
    } else if (fall < 0) {
      const double bottom = e.turn(from + least, least, -1);
      e.at(bottom);
      if (e.f <= 0) {
        slides(e.zero(bend, least));
        slides(e.zero(from + least, least));
      }
    }
  }
}

Regime nearest_ordinary(const LocalBlock& L, const LocalRhs& r, double bn, double* x,
                        double& lambda, int& evaluations) {
  double best[3] = {0, 0, 0}, distance = -1, best_lambda = lambda;
  Regime regime = Regime::separating;
  const auto offer = [&](const double* z, Regime found, double l) {
    double d = 0;
    for (int i = 0; i < 3; ++i) d += (z[i] - x[i]) * (z[i] - x[i]);
    if (distance < 0 || d < distance) {
      distance = d;
      std::copy(z, z + 3, best);
      regime = found;
      best_lambda = l;
    }
  };
  double z[3];
  if (!(bn > 0)) offer(best, Regime::separating, lambda);
  const auto slides = [&](double l) {
    if (!(l >= 0) || !std::isfinite(l)) return;
    Coulomb::slide(L, r, bn, l, z);
    if (z[0] > 0 && std::isfinite(z[0])) offer(z, Regime::sliding, l);
  };
  Secular e(L, r);
  const double least = std::min(L.beta[0], L.beta[1]);
  e.at(0);
  const bool static_ = sticks(L, r, e.s0, e.s1, e.length);
  if (static_) {
    stick(L, r, bn, z);
    offer(z, Regime::sticking, lambda);
  }
  if (e.hh > 0) each_zero(e, L, r, least, static_, slides);
  evaluations += e.evaluations;
  std::copy(best, best + 3, x);
  lambda = best_lambda;
  return regime;
}

}  // namespace

bool Coulomb::only_two(const LocalBlock& L, const LocalRhs& r, double room, double l) {
  const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;
  const double z0 = s0 + l * r.h0, z1 = s1 + l * r.h1, zz = z0 * z0 + z1 * z1, z = std::sqrt(zz);
  const double w1 = r.k * (L.beta[0] + L.beta[1]) - L.g[0] * r.h0 - L.g[1] * r.h1;
  const double straight = w1 + 2 * r.k * l;
  const double d = r.h0 * r.h1 * (L.beta[0] - L.beta[1]), hh = r.h0 * r.h0 + r.h1 * r.h1;
  if (!(straight * z > z0 * r.h0 + z1 * r.h1)) return false;
  if (!(d * d <= 2 * r.k * zz * z || straight * straight >= hh)) return false;
  // The other zero of the first quadratic, by the product of both.
  const double m = (room - (z0 * s0 + z1 * s1) / z) / (r.k * l), s = std::sqrt(s0 * s0 + s1 * s1);
  return m < 0 || (m < l && room - s + m * (w1 - (s0 * r.h0 + s1 * r.h1) / s + m * r.k) < 0);
}

bool Coulomb::safeguarded(const LocalBlock& L, const LocalRhs& r, double warm, double& l,
                          int& evaluations) {
  const double beta_min = std::min(L.beta[0], L.beta[1]), beta_max = std::max(L.beta[0], L.beta[1]);
  const double h = std::sqrt(r.h0 * r.h0 + r.h1 * r.h1), ik = 1 / r.k;
  const double gh = L.g[0] * r.h0 + L.g[1] * r.h1;
  if (!(h * ik < 1e60 * beta_max)) return false;
  auto [lo, hi] = scalar::slip_bracket(L.e, h, ik, beta_min, beta_max);
  if (!(l > lo && l < hi)) l = warm > lo && warm < hi ? warm : lo;
  // A Newton step of 3e-8 leaves round-off unless the two beta are far apart.
  const double stop = beta_max < 1e3 * beta_min ? 3e-8 : 1e-12;
  for (int n = 0; n < kMaxEvaluations; ++n) {
    ++evaluations;
    auto [excess, q, z, zh, slope] =
        scalar::slip_equation(l, r.k, L.beta[0], L.beta[1], L.g[0], L.g[1], r.h0, r.h1, gh);
    double step = excess * q * z / (r.k * slope);
    if (!(slope > 0 && q > 0.1 * z) || n > 8) {  // near the pole of p / q, e > 1: Newton for f
      slope = (r.k * (L.beta[0] + l + (L.beta[1] + l)) - gh) * z - zh;
      step = excess * z / slope;
    }
    if (excess > 0) {
      lo = l;
    } else {
      hi = l;
    }
    double next = l + step;
    if (std::abs(step) <= stop * (l + beta_min) && slope > 0) {
      l = next < lo ? lo : (next > hi ? hi : next);
      return true;
    }
    if (!(next > lo && next < hi) || !(slope > 0)) next = 0.5 * (lo + hi);
    if (next == l || hi - lo <= 1e-16 * (hi + beta_min)) break;
    l = next;
  }
  return true;
}

// In units in which beta and h are near 1. A grazing contact, k far below h / beta: its impulse is
// k h / (|h| + g.h) to more than double precision, or on an asymptote and does not depend on k. It
// is solved with a larger k, and in the first case scaled back.
Regime Coulomb::nearest(const LocalBlock& L, const LocalRhs& r, double bn, double* x,
                        double& lambda, int& evaluations) {
  constexpr double kGrazing = 0x1p-80;
  const double trace = L.beta[0] + L.beta[1];
  const double most = std::max({std::abs(r.h0), std::abs(r.h1), std::abs(r.k) * trace});
  if (!std::isfinite(most) || !std::isfinite(trace)) {
    x[0] = x[1] = x[2] = std::numeric_limits<double>::quiet_NaN();  // sweeps have overflowed
    return Regime::sliding;
  }
  if (!(most > 0)) return nearest_ordinary(L, r, bn, x, lambda, evaluations);
  const int p = -std::ilogb(trace), q = -std::ilogb(most);
  const LocalBlock S = rescaled(L, p);
  double impulse = std::ldexp(bn, q) * S.inv_a;
  LocalRhs s{L.mu * impulse, std::ldexp(r.h0, q), std::ldexp(r.h1, q)};
  double graze = 1;
  if (s.k == 0 && bn > 0) {  // no friction to speak of
    x[0] = bn * L.inv_a;
    x[1] = x[2] = 0;
    return Regime::sliding;
  }
  if (s.k != 0 && std::abs(s.k) < kGrazing) {
    const double k = std::copysign(kGrazing, bn);
    graze = std::abs(s.k) / kGrazing;
    s.k = k;
    impulse = k / L.mu;
  }
  for (int c = 0; c < 3; ++c) x[c] = std::ldexp(x[c], q - p);
  double l = std::ldexp(lambda, p);
  const Regime regime = nearest_ordinary(S, s, impulse * S.a, x, l, evaluations);
  const double t = std::sqrt(x[1] * x[1] + x[2] * x[2]);
  if (graze < 1 && regime == Regime::sliding && t < 0x1p-40) {
    for (int c = 0; c < 3; ++c) x[c] *= graze;
    l /= graze;
  } else if (graze < 1 && regime != Regime::separating) {
    x[0] = t / L.mu;
  }
  for (int c = 0; c < 3; ++c) x[c] = std::ldexp(x[c], p - q);
  lambda = std::ldexp(l, -p);
  return regime;
}

namespace {

TETHER_LAW_KERNELS(Coulomb, CoulombLanes)

}  // namespace

constexpr LawKernels Coulomb::kKernels = all_kernels(nullptr, nullptr);

}  // namespace tether::contact::detail
