// Tether: the public one-contact solves. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/one_contact.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tether/linalg/pi.hpp>

#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

const char* name(Regime regime) {
  switch (regime) {
    case Regime::separating:
      return "separating";
    case Regime::sticking:
      return "sticking";
    case Regime::sliding:
      return "sliding";
  }
  return "?";
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

OneContact solve_one_golden_section(const LocalBlock& L, const Eigen::Vector3d& b,
                                    double angle_tolerance) {
  detail::require_finite("b", b);
  detail::require(angle_tolerance > 0, "angle_tolerance", angle_tolerance, "must be > 0");
  OneContact out;
  if (!(b[0] > 0)) return out;
  double x[3];
  const detail::LocalRhs r = detail::to_local(L, b[0], b[1], b[2]);
  const double s0 = L.beta[1] * r.h0, s1 = L.beta[0] * r.h1, length = std::hypot(s0, s1);
  if (L.mu == 0) {
    out.impulse << b[0] * L.inv_a, 0, 0;
    out.regime = Regime::sliding;
    return out;
  }
  if (detail::sticks(L, r, s0, s1, length)) {
    out.regime = detail::stick(L, r, b[0], x);
    out.impulse << x[0], x[1], x[2];
    return out;
  }
  const double pi = linalg::kPi;
  const double center = std::atan2(s1, s0);
  const double kappa = (r.k * L.beta[0] * L.beta[1] - L.g[0] * s0 - L.g[1] * s1) / length;
  const double reach = kappa <= -1 ? pi : std::acos(std::min(1.0, kappa));
  double lo = center - reach, hi = center + reach;
  if (L.e >= 1) {  // stay between the asymptotes
    const double d = std::remainder(std::atan2(L.g[1], L.g[0]) - center, 2 * pi);
    const double open = std::acos(-1 / L.e);
    lo = std::max(lo, center + d - open);
    hi = std::min(hi, center + d + open);
  }
  const auto radius = [&](double angle) {
    const double q = 1 + L.g[0] * std::cos(angle) + L.g[1] * std::sin(angle);
    return q > 0 ? r.k / q : std::numeric_limits<double>::infinity();
  };
  const auto energy = [&](double angle) {
    ++out.evaluations;
    const double p = radius(angle);
    if (!std::isfinite(p)) return std::numeric_limits<double>::infinity();
    const double y0 = p * std::cos(angle), y1 = p * std::sin(angle);
    return (0.5 * L.beta[0] * y0 - r.h0) * y0 + (0.5 * L.beta[1] * y1 - r.h1) * y1;
  };
  const double ratio = 0.6180339887498948482;
  double left = hi - ratio * (hi - lo), right = lo + ratio * (hi - lo);
  double at_left = energy(left), at_right = energy(right);
  while (hi - lo > angle_tolerance && left < right) {
    if (at_left < at_right) {
      hi = right;
      right = left;
      at_right = at_left;
      left = hi - ratio * (hi - lo);
      at_left = energy(left);
    } else {
      lo = left;
      left = right;
      at_left = at_right;
      right = lo + ratio * (hi - lo);
      at_right = energy(right);
    }
  }
  const double angle = at_left < at_right ? left : right, p = radius(angle);
  detail::from_local(L, p / L.mu, p * std::cos(angle), p * std::sin(angle), x);
  out.impulse << x[0], x[1], x[2];
  out.regime = Regime::sliding;
  return out;
}

PlanarContact solve_planar(Law law, const linalg::Matrix<2, 2>& A, const linalg::Matrix<2, 1>& b,
                           double mu) {
  const double a = A(0, 0), c = 0.5 * (A(0, 1) + A(1, 0));
  detail::require_finite("A", A);
  detail::require_finite("b", b);
  detail::require(a > 0, "A_nn", a, "must be > 0: no body moves along the normal");
  detail::require(mu >= 0 && std::isfinite(mu), "mu", mu, "must be finite and >= 0");
  detail::require(A(1, 1) - c * (c / a) >= -1e-8 * A.trace(), "t - c^2/a", A(1, 1) - c * (c / a),
                  "A must be positive semidefinite");
  PlanarContact out;
  if (!(b[0] > 0)) return out;
  if (!detail::traits(law).friction || mu == 0) {
    out.impulse << b[0] / a, 0;
    out.regime = Regime::sliding;
    return out;
  }
  const double B = std::max(A(1, 1) - c * (c / a), 1e-12 * A.trace()), h = b[1] - c * (b[0] / a);
  // Interval of admissible x_t; a nonpositive denominator is an end at infinity. In the plane both
  // laws pick the same point of it.
  const double infinity = std::numeric_limits<double>::infinity();
  const double lower = a - mu * c > 0 ? -mu * (b[0] / (a - mu * c)) : -infinity;
  const double upper = a + mu * c > 0 ? mu * (b[0] / (a + mu * c)) : infinity;
  const double free = h / B, xt = std::clamp(free, lower, upper);
  out.regime = xt == free ? Regime::sticking : Regime::sliding;
  out.impulse << (out.regime == Regime::sliding ? std::abs(xt) / mu : (b[0] - c * xt) / a), xt;
  return out;
}

}  // namespace tether::contact
