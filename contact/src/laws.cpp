// Tether: derivatives and branches of the friction laws. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "law_coulomb.hpp"
#include "law_frictionless.hpp"
#include "law_maximum_dissipation.hpp"

namespace tether::contact::detail {
namespace {

void derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                Regime regime, bool dissipation, LocalDerivative& out) {
  if (regime == Regime::separating) {
    for (double& d : out.d) d = 0;
    return;
  }
  if (L.mu == 0) {
    Frictionless::derivative(L, bn, b0, b1, x, regime, out);
    return;
  }
  if (regime == Regime::sliding &&
      derivative_sliding(L, to_local(L, bn, b0, b1), x, dissipation, out)) {
    return;
  }
  derivative_sticking(L, out);
}

}  // namespace

void MaximumDissipation::derivative(const LocalBlock& L, double bn, double b0, double b1,
                                    const double* x, Regime regime, LocalDerivative& out) {
  detail::derivative(L, bn, b0, b1, x, regime, true, out);
}

Regime MaximumDissipation::near_asymptote(const LocalBlock& L, const LocalRhs& r, double y0,
                                          double y1, double* x) {
  // Axes: along g and across it, on the side of y. A = k / (e^2 - 1), B = k / sqrt(e^2 - 1).
  const double e = L.e, d0 = L.g[0] / e, d1 = L.g[1] / e;
  const double side = d0 * y1 - d1 * y0 < 0 ? -1 : 1;
  const double a0 = -side * d1, a1 = side * d0;
  const double A = r.k / (e * e - 1), B = r.k / std::sqrt(e * e - 1);
  const double c0 = e * A * d0, c1 = e * A * d1;
  const double p0 = 0.5 * (-A * d0 + B * a0), p1 = 0.5 * (-A * d1 + B * a1);
  const double q0 = 0.5 * (-A * d0 - B * a0), q1 = 0.5 * (-A * d1 - B * a1);
  const double z = std::abs(a0 * y0 + a1 * y1) / B;
  double s = z + std::sqrt(z * z + 1);
  for (int n = 0; n < 30; ++n) {
    const double is = 1 / s;
    y0 = c0 + p0 * s + q0 * is;
    y1 = c1 + p1 * s + q1 * is;
    const double G0 = L.beta[0] * y0 - r.h0, G1 = L.beta[1] * y1 - r.h1;
    const double t0 = p0 - q0 * is * is, t1 = p1 - q1 * is * is;
    const double f = G0 * t0 + G1 * t1;
    const double df = L.beta[0] * t0 * t0 + L.beta[1] * t1 * t1 +
                      2 * is * is * is * (G0 * q0 + G1 * q1);
    double next = s - f / df;
    if (!(next > 1)) next = 0.5 * (1 + s);
    const bool done = std::abs(next - s) <= 1e-13 * s;
    s = next;
    if (done) break;
  }
  y0 = c0 + p0 * s + q0 / s;
  y1 = c1 + p1 * s + q1 / s;
  from_local(L, std::sqrt(y0 * y0 + y1 * y1) / L.mu, y0, y1, x);
  return Regime::sliding;
}

bool MaximumDissipation::singular(const LocalBlock& L, double bn, double b0, double b1, double* x,
                                  Regime& regime, int& evaluations) {
  if (!(bn > 0) || L.mu == 0) return false;
  const LocalRhs r = to_local(L, bn, b0, b1);
  const double h[2] = {r.h0, r.h1};
  const double s = bn * L.inv_a;
  const double noise = 1e-14 * (std::abs(b0) + std::abs(b1) + (std::abs(L.c[0]) + std::abs(L.c[1])) * s);
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
          if (!std::isfinite(z) || L.g[j] * z > left || (found && std::abs(z) > std::abs(y[j]))) continue;
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

void Coulomb::derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                         Regime regime, LocalDerivative& out) {
  detail::derivative(L, bn, b0, b1, x, regime, false, out);
}

Regime Coulomb::nearest(const LocalBlock& L, double bn, double b0, double b1, double* x,
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
  const LocalRhs r = to_local(L, bn, b0, b1);
  const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1;
  if (sticks(L, r, s0, s1, std::sqrt(s0 * s0 + s1 * s1))) {
    stick(L, r, bn, z);
    offer(z, Regime::sticking, lambda);
  }
  // Sign changes of s - k on a logarithmic grid, 6 decades around beta, and beyond it up to the
  // asymptote lambda ~ (|h| + g.h) / k.
  const double beta_min = std::min(L.beta[0], L.beta[1]), beta_max = std::max(L.beta[0], L.beta[1]);
  const auto excess = [&](double l) {
    ++evaluations;
    const double y0 = r.h0 / (L.beta[0] + l), y1 = r.h1 / (L.beta[1] + l);
    return std::sqrt(y0 * y0 + y1 * y1) + L.g[0] * y0 + L.g[1] * y1 - r.k;
  };
  constexpr int kGrid = 40;
  const double first = 1e-6 * beta_min, last = 1e6 * beta_max;
  const double h = std::sqrt(r.h0 * r.h0 + r.h1 * r.h1);
  const double end = 2 * (1 + L.e) * h / std::abs(r.k);
  const double factor = std::pow(last / first, 1.0 / (kGrid - 1));
  double left = 0, value = excess(0), right = first;
  for (int n = 0; n <= kGrid; ++n, right *= factor) {
    if (n == kGrid) {
      if (!(end > left && end < 1e300)) break;
      right = end;
    }
    const double at = excess(right);
    if ((value > 0) != (at > 0)) {
      // Either direction: bisection to a few digits, then Newton on s - k with the bracket kept.
      double lo = left, hi = right, l = 0.5 * (lo + hi);
      for (int m = 0; m < 200; ++m) {
        const double d0 = 1 / (L.beta[0] + l), d1 = 1 / (L.beta[1] + l);
        const double y0 = r.h0 * d0, y1 = r.h1 * d1, length = std::sqrt(y0 * y0 + y1 * y1);
        const double f = length + L.g[0] * y0 + L.g[1] * y1 - r.k;
        ++evaluations;
        const double d =
            -((y0 / length + L.g[0]) * y0 * d0 + (y1 / length + L.g[1]) * y1 * d1);
        ((f > 0) == (value > 0) ? lo : hi) = l;
        const double step = -f / d;
        double next = l + step;
        if (std::abs(step) <= 1e-12 * (l + beta_min)) {
          if (next >= lo && next <= hi) l = next;
          break;
        }
        if (!(next > lo && next < hi)) next = hi > 1e3 * lo && lo > 0 ? std::sqrt(lo * hi) : 0.5 * (lo + hi);
        if (next == l) break;
        l = next;
      }
      const double y0 = r.h0 / (L.beta[0] + l), y1 = r.h1 / (L.beta[1] + l);
      from_local(L, std::sqrt(y0 * y0 + y1 * y1) / L.mu, y0, y1, z);
      offer(z, Regime::sliding, l);
    }
    left = right;
    value = at;
  }
  std::copy(best, best + 3, x);
  lambda = best_lambda;
  return regime;
}

}  // namespace tether::contact::detail
