// Tether: points of the second-order cone and their scaling. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::linalg {

// Points x of the cone |x_t| <= x_n have four entries, x_n, x_t and the gap x_n - |x_t|: close to
// the cone the difference of the first three has lost its digits.

/// |x_t|.
inline double tangent(const double* x) { return std::sqrt(x[1] * x[1] + x[2] * x[2]); }
/// x_n^2 - |x_t|^2, from the gap.
inline double determinant(const double* x) { return x[3] * (x[3] + 2 * tangent(x)); }

/// x.u >= 0 for two points of the cone, without cancellation where they are nearly orthogonal.
inline double product(const double* x, const double* u) {
  const double tx = tangent(x), tu = tangent(u), along = x[1] * u[1] + x[2] * u[2];
  double rest = tx * tu + along;
  if (along < 0) {
    const double across = x[1] * u[2] - x[2] * u[1];
    rest = across * across / (tx * tu - along);
  }
  return x[3] * u[0] + tx * u[3] + rest;
}

/// Largest t with x + t d in the cone, which may be infinite; determinant = x_n^2 - |x_t|^2. d has
/// three entries.
inline double longest(const double* x, double determinant, const double* d) {
  // det(x + t d) = a t^2 + 2 b t + c
  const double a = d[0] * d[0] - d[1] * d[1] - d[2] * d[2];
  const double b = x[0] * d[0] - x[1] * d[1] - x[2] * d[2], c = determinant;
  double t = std::numeric_limits<double>::infinity();
  // Quotients beyond 1e300 are as good as infinite, and are not formed: they would overflow.
  const auto take = [&t](double above, double below) {
    if (above == 0 || (above > 0) != (below > 0)) return;
    if (1e-300 * std::abs(above) < std::abs(below)) t = std::min(t, above / below);
  };
  if (d[0] < 0) take(-x[0], d[0]);
  const double D = b * b - a * c;
  if (D >= 0) {
    const double q = -(b + std::copysign(std::sqrt(D), b));
    take(c, q);
    take(q, a);
  }
  return t;
}

/// Scaling by Nesterov and Todd (Math. Oper. Res. 22, 1997, 1), W x = W^-1 u = lambda. W is
/// symmetric and diagonal in the frame Q, and W^2 = theta (2 omega omega' - J), J = diag(1, -1,
/// -1). With t the direction of omega_t, its eigenvectors are (1, t), (1, -t), both over sqrt(2),
/// and the tangent across t.
struct ConeScaling {
  double Q[9];        ///< rows: eigenvectors
  double d[3];        ///< eigenvalues of W
  double lambda[3];   ///< the scaled point, in the axes of x
  double lambda_det;  ///< its determinant(), the product of the roots of those of x and u

  /// A single positive number in place of the cone. False: one of both is not.
  bool set_flat(double x, double u) {
    if (!(x > 0 && u > 0)) return false;
    *this = {
        {1, 0, 0, 0, 1, 0, 0, 0, 1}, {std::sqrt(u / x), 1, 1}, {std::sqrt(x * u), 0, 0}, x * u};
    return true;
  }
  /// For points x and u of four entries. False: one is not inside of the cone.
  bool set(const double* x, const double* u) {
    const double square_x = determinant(x), square_u = determinant(u);
    if (!(square_x > 0 && square_u > 0)) return false;
    const double dx = std::sqrt(square_x), du = std::sqrt(square_u);
    const double half = std::sqrt(0.5 * (1 + product(x, u) / (dx * du)));
    const double w1 = (u[1] / du - x[1] / dx) / (2 * half);
    const double w2 = (u[2] / du - x[2] / dx) / (2 * half);
    const double t = std::sqrt(w1 * w1 + w2 * w2), h = std::sqrt(0.5);
    const double t1 = t > 0 ? w1 / t : 1, t2 = t > 0 ? w2 / t : 0;
    const double frame[9] = {h, h * t1, h * t2, h, -h * t1, -h * t2, 0, -t2, t1};
    std::copy(frame, frame + 9, Q);
    const double root = std::sqrt(du / dx), stretch = std::sqrt(1 + t * t) + t;
    d[0] = root * stretch;
    d[1] = root / stretch;
    d[2] = root;
    lambda_det = dx * du;
    const double g = std::sqrt(lambda_det), q = g / (x[0] / dx + u[0] / du + 2 * half);
    lambda[0] = g * half;
    for (int c = 1; c < 3; ++c)
      lambda[c] = q * ((half + u[0] / du) * x[c] / dx + (half + x[0] / dx) * u[c] / du);
    return true;
  }
  /// y = Q x, into the frame.
  void turn(const double* x, double* y) const {
    for (int r = 0; r < 3; ++r) y[r] = Q[3 * r] * x[0] + Q[3 * r + 1] * x[1] + Q[3 * r + 2] * x[2];
  }
  /// x = Q' y, back.
  void turn_back(const double* y, double* x) const {
    for (int c = 0; c < 3; ++c) x[c] = Q[c] * y[0] + Q[3 + c] * y[1] + Q[6 + c] * y[2];
  }
};

}  // namespace tether::linalg
