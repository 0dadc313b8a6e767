// Tether: the linear relation between changes of one contact's impulse and velocity under a law
// (method, eq. 19). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/contact/one_contact.hpp>

namespace tether::contact::detail {

/// At a solution (x, w) of one contact, on the branch of the regime:
///
///     P dx + Q dw + friction dmu + coupling dgamma = 0,
///     dgamma = dmu c/a + mu (dc - c da/a) / a,
///
/// a = A_nn and c = A_tn of the contact's own block. `coupling` is 0 under laws whose slip is
/// opposite to friction. Rows have arbitrary lengths.
struct LawTangent {
  double P[3][3] = {}, Q[3][3] = {}, friction[3] = {}, coupling[3][2] = {};
  Regime regime = Regime::separating;
  Regime other = Regime::separating;  ///< the regime beyond the nearest kink
  double margin = 0;                  ///< distance to it, a velocity (impulses times a)

  void nearer(double distance, Regime beyond) {
    if (!(distance < margin)) return;
    margin = distance;
    other = beyond;
  }
};

/// Parting or touching, by which of w_n and a x_n is larger. True: parting, and all is said.
inline bool parting_tangent(const LocalBlock& L, const double* x, const double* w,
                            LawTangent& out) {
  const double pressed = L.a * x[0];
  out.margin = std::max(pressed, w[0]);
  if (pressed > w[0]) {
    out.Q[0][0] = 1;  // w_n = 0
    return false;
  }
  out.regime = Regime::separating;
  out.other = Regime::sliding;
  for (int c = 0; c < 3; ++c) out.P[c][c] = 1;
  return true;
}

/// A law that keeps impulses in the friction cone and slides along w_t = -s (u + gamma), s >= 0,
/// u = x_t / |x_t|: |x_t| = mu x_n and R(u + gamma) . w_t = 0, R a quarter turn. Differentiated,
/// with du = Ru (Ru . dx_t) / |x_t| and both times |x_t|:
///
///     |x_t| Rp . dw_t + s (p . u) Ru . dx_t + s |x_t| Rp . dgamma = 0,   p = u + gamma.
///
/// gamma null: slip is opposite to friction.
inline void cone_tangent(const LocalBlock& L, const double* gamma, const double* x, const double* w,
                         LawTangent& out) {
  if (parting_tangent(L, x, w, out)) return;
  const double t = std::hypot(x[1], x[2]), slip = std::hypot(w[1], w[2]);
  const double inside = L.a * ((L.mu * x[0] - t) / std::hypot(1.0, L.mu));
  if (L.mu > 0 && inside >= slip) {
    out.regime = Regime::sticking;
    out.nearer(inside, Regime::sliding);
    out.Q[1][1] = out.Q[2][2] = 1;
    return;
  }
  out.regime = Regime::sliding;
  // Without friction a contact that does not slip would not begin to with a little of it.
  if (L.mu > 0) out.nearer(slip, Regime::sticking);
  const double *along = t > 0 ? x + 1 : w + 1, length = t > 0 ? t : -slip;
  const double u0 = length != 0 ? along[0] / length : 1, u1 = length != 0 ? along[1] / length : 0;
  const double p0 = gamma ? u0 + gamma[0] : u0, p1 = gamma ? u1 + gamma[1] : u1;
  const double pp = p0 * p0 + p1 * p1;
  const double s = pp > 0 ? std::max(0.0, -(w[1] * p0 + w[2] * p1) / pp) : 0;
  const double friction = L.a * t, turning = L.mu > 0 ? s * (p0 * u0 + p1 * u1) : 1;
  out.P[1][0] = -L.mu;
  out.P[1][1] = u0;
  out.P[1][2] = u1;
  out.friction[1] = L.mu > 0 || slip > 0 ? -x[0] : 0;
  out.P[2][1] = -turning * L.a * u1;
  out.P[2][2] = turning * L.a * u0;
  out.Q[2][1] = -friction * p1;
  out.Q[2][2] = friction * p0;
  if (gamma == nullptr) return;
  out.coupling[2][0] = -s * friction * p1;
  out.coupling[2][1] = s * friction * p0;
}

}  // namespace tether::contact::detail
