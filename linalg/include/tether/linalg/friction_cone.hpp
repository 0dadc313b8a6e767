// Tether: the friction cone |x_t| <= mu x_n and the slip that goes with it.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <tether/linalg/vector_code.hpp>

namespace tether::linalg {

/// v <- its nearest point (Euclid) of the cone |v_t| <= mu v_n, mu >= 0; three entries.
TETHER_INLINE void project_cone(double mu, double* v) {
  const double t = std::sqrt(v[1] * v[1] + v[2] * v[2]);
  if (mu * t <= -v[0]) {
    v[0] = v[1] = v[2] = 0;
    return;
  }
  if (t <= mu * v[0]) return;
  const double n = (v[0] + mu * t) / (1 + mu * mu), f = t > 0 ? mu * n / t : 0;
  v[0] = n;
  v[1] *= f;
  v[2] *= f;
}

/// v <- the point of the cone with the same v_n > 0 and direction of v_t; 0 for v_n <= 0.
TETHER_INLINE void clip_cone(double mu, double* v) {
  if (!(v[0] > 0)) {
    v[0] = v[1] = v[2] = 0;
    return;
  }
  const double t2 = v[1] * v[1] + v[2] * v[2], r = mu * v[0];
  if (t2 <= r * r) return;
  const double f = r / std::sqrt(t2);
  v[1] *= f;
  v[2] *= f;
}

/// The slip variable of a law: s >= 0 with s = |w_t + s gamma|. Where there is none (|gamma| >= 1),
/// |w_t|. Coulomb's law has gamma = 0.
TETHER_INLINE double slip(double w0, double w1, double g0, double g1) {
  const double ww = w0 * w0 + w1 * w1, gg = g0 * g0 + g1 * g1;
  if (gg == 0) return std::sqrt(ww);
  const double wg = w0 * g0 + w1 * g1, q = 1 - gg;
  const double D = wg * wg + q * ww;
  if (!(D >= 0)) return std::sqrt(ww);
  const double root = std::sqrt(D);
  // q s^2 - 2 wg s - ww = 0
  if (wg + root > 0 && q > 0) return (wg + root) / q;
  if (root - wg > 0) return ww / (root - wg);
  return std::sqrt(ww);
}

/// v <- P_K(x - w - (mu s, s gamma)), s = slip(w_t, gamma): x solves the law where v = x
/// (docs/method/contact.md, eq. 21). Three entries each.
TETHER_INLINE void cone_natural_point(double mu, double g0, double g1, const double* x,
                                      const double* w, double* v) {
  const double s = slip(w[1], w[2], g0, g1);
  v[0] = x[0] - w[0] - mu * s;
  v[1] = x[1] - w[1] - s * g0;
  v[2] = x[2] - w[2] - s * g1;
  project_cone(mu, v);
}

}  // namespace tether::linalg
