// Tether: maximum dissipation: rare branches and kernels. SPDX-License-Identifier: BSD-3-Clause

#include "law/maximum_dissipation.hpp"

#include <algorithm>
#include <limits>

#include "law/coulomb.hpp"
#include "law/kernels/define_law.hpp"
#include "law/kernels/group_pass.hpp"

#if TETHER_GROUPS

namespace tether::contact::detail::avx2 {
namespace {

#define TETHER_TEXT TETHER_AVX2
#include "law/maximum_dissipation_arc.hpp"
#undef TETHER_TEXT

struct MaximumDissipationLanes {
  // No sticking or separating lane needs the rare parts of this law.
  TETHER_AVX2 v4 rare(const LaneBlocks&, v4, v4, v4) { return all(0); }

  TETHER_AVX2 Sliding slide(const LaneBlocks& L, v4 bn, v4 k, v4 h0, v4 h1, v4 s0, v4 s1, v4 length,
                            v4 w0, v4 w1, v4 lambda, v4 wanted) {
    const v4 zero = all(0), one = all(1);
    const Arc a = visible_arc(k, L.beta0, L.beta1, L.g0, L.g1, h0, h1, s0, s1,
                              most(length, all(1e-300)), at_most(one, L.ee), w0, w1, wanted);
    const v4 q0 = a.q0, q1 = a.q1, q2 = a.q2, q3 = a.q3, q4 = a.q4;
    v4 lo = a.lo, hi = a.hi, t = a.t;
    const v4 d1 = 2.0 * q2, d2 = 3.0 * q3, d3 = 4.0 * q4;
    v4 active = wanted;
    for (int n = 0; n < kMaxEvaluations; ++n) {
      const v4 f = (((q4 * t + q3) * t + q2) * t + q1) * t + q0;
      const v4 d = ((d3 * t + d2) * t + d1) * t + q1;
      const v4 below = less(f, zero);
      lo = choose(below, t, lo);
      hi = choose(below, hi, t);
      const v4 rising = less(zero, d), step = -f / or_one(rising, d), length_ = size(step);
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
    const auto [v0, v1] = direction(a, t);
    const v4 denominator = most(one + L.g0 * v0 + L.g1 * v1, all(1e-16) * (one + L.ee));
    const v4 opening = L.ee - one;
    const v4 id = one / denominator, radius = k * id;
    return {bn * L.inv_a * id, radius * v0, radius * v1, lambda,
            either(either(at_most(length, all(1e-140)), at_most(all(1e140), length)),
                   both(less(zero, opening), less(denominator, all(1e-3) * opening)))};
  }
};

}  // namespace
}  // namespace tether::contact::detail::avx2

#endif

namespace tether::contact::detail {

// Not inlined into kernels that are built for several machines: its bits are the same on all.
__attribute__((noinline)) void MaximumDissipation::derivative(const LocalBlock& L, double bn,
                                                              double b0, double b1, const double* x,
                                                              Regime regime, LocalDerivative& out) {
  cone_derivative(L, bn, b0, b1, x, regime, true, out);
}

Regime MaximumDissipation::in_other_units(const LocalBlock& L, double bn, double b0, double b1,
                                          double* x, int& evaluations) {
  const LocalRhs r = to_local(L, bn, b0, b1);
  const double h = std::max(std::abs(r.h0), std::abs(r.h1)), trace = L.beta[0] + L.beta[1];
  if (!(h > 0) || !std::isfinite(h) || !std::isfinite(trace)) {
    x[0] = x[1] = x[2] = std::numeric_limits<double>::quiet_NaN();  // sweeps have overflowed
    return Regime::sliding;
  }
  const int p = -std::ilogb(trace), q = -std::ilogb(h);
  double none = -1;
  for (int c = 0; c < 3; ++c) x[c] = std::ldexp(x[c], q - p);
  const Regime regime = solve(rescaled(L, p), std::ldexp(bn, q), std::ldexp(b0, q),
                              std::ldexp(b1, q), x, none, evaluations);
  for (int c = 0; c < 3; ++c) x[c] = std::ldexp(x[c], p - q);
  return regime;
}

Regime MaximumDissipation::near_asymptote(const LocalBlock& L, const LocalRhs& r, double y0,
                                          double y1, double* x) {
  // Axes: along g and across it, on the side of y. In units of k: A = 1 / (e^2 - 1) and B = 1 /
  // sqrt(e^2 - 1), so that no product leaves the range where k is tiny.
  const double e = L.e, d0 = L.g[0] / e, d1 = L.g[1] / e;
  const double side = d0 * y1 - d1 * y0 < 0 ? -1 : 1;
  const double a0 = -side * d1, a1 = side * d0;
  const double A = 1 / (e * e - 1), B = 1 / std::sqrt(e * e - 1);
  const double c0 = e * A * d0, c1 = e * A * d1;
  const double p0 = 0.5 * (-A * d0 + B * a0), p1 = 0.5 * (-A * d1 + B * a1);
  const double q0 = 0.5 * (-A * d0 - B * a0), q1 = 0.5 * (-A * d1 - B * a1);
  const double b0 = r.k * L.beta[0], b1 = r.k * L.beta[1];
  const double z = std::abs(a0 * (y0 / r.k) + a1 * (y1 / r.k)) / B;
  double s = z + std::hypot(z, 1.0);
  for (int n = 0; n < 30; ++n) {
    const double is = 1 / s;
    y0 = c0 + p0 * s + q0 * is;
    y1 = c1 + p1 * s + q1 * is;
    const double G0 = b0 * y0 - r.h0, G1 = b1 * y1 - r.h1;
    const double t0 = p0 - q0 * is * is, t1 = p1 - q1 * is * is;
    const double f = G0 * t0 + G1 * t1;
    const double df = b0 * t0 * t0 + b1 * t1 * t1 + 2 * is * is * is * (G0 * q0 + G1 * q1);
    double next = s - f / df;
    if (!(next > 1)) next = 0.5 * (1 + s);
    const bool done = std::abs(next - s) <= 1e-13 * s;
    s = next;
    if (done) break;
  }
  y0 = r.k * (c0 + p0 * s + q0 / s);
  y1 = r.k * (c1 + p1 * s + q1 / s);
  from_local(L, std::hypot(y0, y1) / L.mu, y0, y1, x);
  return Regime::sliding;
}

bool MaximumDissipation::solve_singular(const LocalBlock& L, double bn, double b0, double b1,
                                        double* x, Regime& regime, int& evaluations) {
  if (!(bn > 0) || L.mu == 0) return false;
  const LocalRhs r = to_local(L, bn, b0, b1);
  const double h[2] = {r.h0, r.h1};
  const double s = bn * L.inv_a;
  const double noise =
      1e-14 * (std::abs(b0) + std::abs(b1) + (std::abs(L.c[0]) + std::abs(L.c[1])) * s);
  for (int i = 0; i < 2; ++i)
    if (L.null[i] && std::abs(h[i]) > noise) return false;
  double y[2] = {0, 0};
  if (!(L.null[0] && L.null[1])) {
    const int j = L.null[0] ? 0 : 1, i = 1 - j;
    y[i] = h[i] / L.beta[i];
    const double left = r.k - L.g[i] * y[i];
    if (std::abs(y[i]) > left) {
      // On the conic: (1 - g_j^2) y_j^2 + 2 g_j left y_j + y_i^2 - left^2 = 0, left >= g_j y_j.
      const double A = 1 - L.g[j] * L.g[j], H = L.g[j] * left, C = (y[i] - left) * (y[i] + left);
      const double D = H * H - A * C;
      bool found = false;
      if (D >= 0) {
        const double q = -(H + std::copysign(std::sqrt(D), H));
        for (double z : {q / A, C / q}) {
          if (!std::isfinite(z) || L.g[j] * z > left || (found && std::abs(z) > std::abs(y[j])))
            continue;
          y[j] = z;
          found = true;
        }
      }
      if (!found) {  // out of reach: on the arc, where the null direction hardly counts
        LocalBlock weak = L;
        weak.beta[j] = 1e-4 * L.beta[j];
        double none = -1;
        regime = solve(weak, bn, b0, b1, x, none, evaluations);
        return true;
      }
      // Scaled onto the conic: cone and plane hold to round-off.
      const double length = std::sqrt(y[0] * y[0] + y[1] * y[1]);
      const double f = 1 / (length + L.g[0] * y[0] + L.g[1] * y[1]);
      if (f > 0 && std::isfinite(f)) {
        from_local(L, s * length * f, r.k * y[0] * f, r.k * y[1] * f, x);
        regime = Regime::sliding;
        return true;
      }
      return false;
    }
  }
  from_local(L, 0, y[0], y[1], x);
  x[0] = (bn - L.c[0] * x[1] - L.c[1] * x[2]) * L.inv_a;
  regime = Regime::sticking;
  return true;
}

namespace {

using Mix = Laws<MaximumDissipation, Coulomb>;
TETHER_LAW_KERNELS(MaximumDissipation, MaximumDissipationLanes)
TETHER_ASSEMBLED_KERNELS(mixed, Mix)

}  // namespace

constexpr LawKernels MaximumDissipation::kKernels = all_kernels(&Coulomb::kKernels, &mixed);

}  // namespace tether::contact::detail
