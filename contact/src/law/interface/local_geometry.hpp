// Tether: frames, regimes and tangents that all friction laws share.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/contact/one_contact.hpp>
#include <tether/linalg/vector_code.hpp>

#include "problem/criterion.hpp"

namespace tether::contact::detail {

using namespace linalg;  // blocks, cones, vector code: shared with the projection's side

constexpr int kMaxEvaluations = 80;  // of the scalar equation of a sliding contact

// Right-hand side in the diagonal frame. The boundary of the friction disc on the plane w_n = 0 is
// the conic |y| + g.y = k with a focus at the origin (method, eq. 7).
struct LocalRhs {
  double k, h0, h1;
};

TETHER_INLINE LocalRhs to_local(const LocalBlock& L, double bn, double b0, double b1) {
  const double s = bn * L.inv_a;
  const double h0 = b0 - L.c[0] * s, h1 = b1 - L.c[1] * s;
  return {L.mu * s, L.cosine * h0 + L.sine * h1, L.cosine * h1 - L.sine * h0};
}

// x from the tangential impulse y in the diagonal frame and the normal impulse.
TETHER_INLINE void from_local(const LocalBlock& L, double xn, double y0, double y1, double* x) {
  x[0] = xn;
  x[1] = L.cosine * y0 - L.sine * y1;
  x[2] = L.sine * y0 + L.cosine * y1;
}

TETHER_INLINE Regime separate(double* x) {
  x[0] = x[1] = x[2] = 0;
  return Regime::separating;
}

// Static impulse y = h / beta, which is admissible iff |y| + g.y <= k (tested without division).
TETHER_INLINE bool sticks(const LocalBlock& L, const LocalRhs& r, double y0, double y1,
                          double length) {
  return length + L.g[0] * y0 + L.g[1] * y1 <= r.k * L.beta[0] * L.beta[1];
}

TETHER_INLINE Regime stick(const LocalBlock& L, const LocalRhs& r, double bn, double* x) {
  const double y0 = r.h0 / L.beta[0], y1 = r.h1 / L.beta[1];
  from_local(L, 0, y0, y1, x);
  x[0] = (bn - L.c[0] * x[1] - L.c[1] * x[2]) * L.inv_a;
  return Regime::sticking;
}

// 3x3 derivative of the impulse with respect to b, row-major.
struct LocalDerivative {
  double d[9];
};

// From dy = Y (dh, dk) (2x3, diagonal frame) to dx/db.
TETHER_INLINE void derivative_from_local(const LocalBlock& L, const double Y[2][3],
                                         LocalDerivative& out) {
  const double V[2][2] = {{L.cosine, -L.sine}, {L.sine, L.cosine}};
  // dh = V' (db_t - c/a db_n), dk = mu/a db_n
  double R[3][3];
  for (int i = 0; i < 2; ++i) {
    R[i][1] = V[0][i];
    R[i][2] = V[1][i];
    R[i][0] = -(V[0][i] * L.c[0] + V[1][i] * L.c[1]) * L.inv_a;
  }
  R[2][0] = L.mu * L.inv_a;
  R[2][1] = R[2][2] = 0;
  double dy[2][3];
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 3; ++j)
      dy[i][j] = Y[i][0] * R[0][j] + Y[i][1] * R[1][j] + Y[i][2] * R[2][j];
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 3; ++j) out.d[3 * (i + 1) + j] = V[i][0] * dy[0][j] + V[i][1] * dy[1][j];
  for (int j = 0; j < 3; ++j)
    out.d[j] = ((j == 0 ? 1 : 0) - L.c[0] * out.d[3 + j] - L.c[1] * out.d[6 + j]) * L.inv_a;
}

inline void derivative_sticking(const LocalBlock& L, LocalDerivative& out) {
  const double Y[2][3] = {{1 / L.beta[0], 0, 0}, {0, 1 / L.beta[1], 0}};
  derivative_from_local(L, Y, out);
}

// Sliding: (diag(beta) + nu (I - gamma gamma')) y = h - nu k gamma on |y| + g.y = k, with gamma = g
// (maximum_dissipation) or 0 (coulomb). x is the solution; nu follows from it.
inline bool derivative_sliding(const LocalBlock& L, const LocalRhs& r, const double* x,
                               bool dissipation, LocalDerivative& out) {
  const double y0 = L.cosine * x[1] + L.sine * x[2], y1 = L.cosine * x[2] - L.sine * x[1];
  const double length = std::sqrt(y0 * y0 + y1 * y1);
  if (!(length > 0)) return false;
  const double q0 = dissipation ? L.g[0] : 0, q1 = dissipation ? L.g[1] : 0;
  const double z0 = y0 + length * q0, z1 = y1 + length * q1;
  const double zz = z0 * z0 + z1 * z1;
  if (!(zz > 0)) return false;
  double nu = ((r.h0 - L.beta[0] * y0) * z0 + (r.h1 - L.beta[1] * y1) * z1) / zz;
  if (!(nu > 0)) nu = 0;
  const double m00 = L.beta[0] + nu * (1 - q0 * q0), m11 = L.beta[1] + nu * (1 - q1 * q1);
  const double m01 = -nu * q0 * q1, det = m00 * m11 - m01 * m01;
  if (!(std::abs(det) > 1e-14 * (m00 * m00 + m11 * m11))) return false;
  const double E00 = m11 / det, E11 = m00 / det, E01 = -m01 / det;
  const double p0 = y0 / length + L.g[0], p1 = y1 / length + L.g[1];
  const double Ez0 = E00 * z0 + E01 * z1, Ez1 = E01 * z0 + E11 * z1;
  const double Ep0 = E00 * p0 + E01 * p1, Ep1 = E01 * p0 + E11 * p1;
  const double pEz = p0 * Ez0 + p1 * Ez1;
  if (!(std::abs(pEz) > 1e-14 * (std::abs(p0 * Ez0) + std::abs(p1 * Ez1)))) return false;
  const double W[2][2] = {{E00 - Ez0 * Ep0 / pEz, E01 - Ez0 * Ep1 / pEz},
                          {E01 - Ez1 * Ep0 / pEz, E11 - Ez1 * Ep1 / pEz}};
  double Y[2][3];
  for (int i = 0; i < 2; ++i) {
    Y[i][0] = W[i][0];
    Y[i][1] = W[i][1];
    Y[i][2] = -nu * (W[i][0] * q0 + W[i][1] * q1) + (i == 0 ? Ez0 : Ez1) / pEz;
  }
  derivative_from_local(L, Y, out);
  return true;
}

// Error of the solution x in that regime, for a law that keeps impulses in the cone.
inline void cone_derivative(const LocalBlock& L, double bn, double b0, double b1, const double* x,
                            Regime regime, bool dissipation, LocalDerivative& out) {
  if (regime == Regime::separating || L.mu == 0) {
    for (double& d : out.d) d = 0;
    if (regime != Regime::separating) out.d[0] = L.inv_a;
    return;
  }
  if (regime == Regime::sliding &&
      derivative_sliding(L, to_local(L, bn, b0, b1), x, dissipation, out)) {
    return;
  }
  derivative_sticking(L, out);
}

/// Parts of a law whose slip is opposite to friction. Null directions of a block have a raised
/// beta: nothing else is special about them.
struct OppositeSlip {
  static TETHER_INLINE bool solve_singular(const LocalBlock&, double, double, double, double*,
                                           Regime&, int&) {
    return false;
  }
  static TETHER_INLINE void gamma(const LocalBlock&, double* out) { out[0] = out[1] = 0; }
};

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
