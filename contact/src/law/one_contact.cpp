// Tether: the public one-contact solves. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/one_contact.hpp>

#include <algorithm>
#include <cmath>

#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

const char* name(Regime regime) {
  return detail::text(regime, {"separating", "sticking", "sliding"});
}

LocalBlock::LocalBlock(const Eigen::Matrix3d& A, double friction) {
  detail::require(friction >= 0 && std::isfinite(friction), "mu", friction,
                  "must be finite and >= 0");
  // Entry by entry: sums may overflow, comparisons with NaN are false.
  double trace = A.trace();
  if (!A.allFinite()) detail::require_finite("A", A);
  detail::require(std::isfinite(trace), "trace of A", trace, "must be finite");
  a = A(0, 0);
  detail::require(a > 0, "A_nn", a, "must be > 0: no body moves along the normal");
  inv_a = 1 / a;
  detail::require(std::isfinite(inv_a), "A_nn", a, "must be > 1 / the largest number");
  ordinary = trace > detail::kLeastOrdinary && trace < detail::kMostOrdinary;
  mu = friction;
  c[0] = 0.5 * (A(0, 1) + A(1, 0));
  c[1] = 0.5 * (A(0, 2) + A(2, 0));
  // B = T - c c'/a and its rotation V, tan(2 theta) = 2 B01 / (B00 - B11).
  const double B00 = A(1, 1) - c[0] * (c[0] * inv_a), B11 = A(2, 2) - c[1] * (c[1] * inv_a);
  const double B01 = 0.5 * (A(1, 2) + A(2, 1)) - c[0] * (c[1] * inv_a);
  cosine = 1;
  sine = 0;
  beta[0] = B00;
  beta[1] = B11;
  if (B01 != 0) {
    // Jacobi rotation with |theta| <= pi/4.
    const double theta = (B11 - B00) / (2 * B01);
    const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
    cosine = 1 / std::sqrt(t * t + 1);
    sine = -t * cosine;
    beta[0] = B00 - t * B01;
    beta[1] = B11 + t * B01;
  }
  detail::require(std::min(beta[0], beta[1]) >= -1e-8 * trace, "least eigenvalue of T - c c'/a",
                  std::min(beta[0], beta[1]), "A must be positive semidefinite");
  const double floor = 1e-12 * trace;
  for (int i = 0; i < 2; ++i) {
    null[i] = !(beta[i] >= floor);
    if (null[i]) beta[i] = floor;
  }
  const double cc = cosine * cosine, ss = sine * sine, cs = cosine * sine;
  T[0] = cc * beta[0] + ss * beta[1] + c[0] * (c[0] * inv_a);
  T[1] = cs * (beta[0] - beta[1]) + c[0] * (c[1] * inv_a);
  T[2] = ss * beta[0] + cc * beta[1] + c[1] * (c[1] * inv_a);
  // mu / a may overflow where g does not.
  const double steep = mu * inv_a;
  const auto times = [&](double v) { return std::isfinite(steep) ? steep * v : mu * (inv_a * v); };
  g[0] = times(cosine * c[0] + sine * c[1]);
  g[1] = times(cosine * c[1] - sine * c[0]);
  e = std::sqrt(g[0] * g[0] + g[1] * g[1]);
  // Kantorovich: the angle between y and E y, E = diag(1 / (beta + lambda)), has at least this
  // cosine.
  const double q = std::min(beta[0], beta[1]) / std::max(beta[0], beta[1]);
  unique = e * (1 + q) <= 2 * std::sqrt(q) && e < 1;
}

Eigen::Matrix3d LocalBlock::matrix() const {
  Eigen::Matrix3d A;
  A << a, c[0], c[1], c[0], T[0], T[1], c[1], T[1], T[2];
  return A;
}

namespace {

void solve_ordinary(Law law, const LocalBlock& block, const Eigen::Vector3d& b, LocalState& s) {
  s.regime = detail::kernels(law).solve(block, b.data(), s.x, s.lambda, s.evaluations);
}

// In units in which the traces and the largest component of b are near 1: the same bits.
void solve_rescaled(Law law, const LocalBlock& block, const Eigen::Vector3d& b, double most,
                    LocalState& s) {
  const int p = -std::ilogb(block.a + block.T[0] + block.T[2]), q = -std::ilogb(most);
  for (double& x : s.x) x = std::ldexp(x, q - p);
  s.lambda = std::ldexp(s.lambda, p);
  solve_ordinary(law, detail::rescaled(block, p),
                 {std::ldexp(b[0], q), std::ldexp(b[1], q), std::ldexp(b[2], q)}, s);
  for (double& x : s.x) x = std::ldexp(x, p - q);
  s.lambda = std::ldexp(s.lambda, -p);
}

}  // namespace

void solve_local(Law law, const LocalBlock& block, const Eigen::Vector3d& b, LocalState& s) {
  s.evaluations = 0;
  const double most = std::max({std::abs(b[0]), std::abs(b[1]), std::abs(b[2])});
  if (block.ordinary & (most > detail::kLeastOrdinary) & (most < detail::kMostOrdinary))
    return solve_ordinary(law, block, b, s);
  if (!(most > 0) || !std::isfinite(most)) return solve_ordinary(law, block, b, s);
  solve_rescaled(law, block, b, most, s);
}

OneContact solve_one(Law law, const Eigen::Matrix3d& A, const Eigen::Vector3d& b, double mu) {
  detail::require_finite("b", b);
  LocalState state;
  solve_local(law, LocalBlock(A, mu), b, state);
  return {Eigen::Vector3d(state.x[0], state.x[1], state.x[2]), state.regime, state.evaluations};
}

}  // namespace tether::contact
