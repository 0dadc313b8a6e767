// Tether: one contact with rolling and torsional friction. SPDX-License-Identifier: BSD-3-Clause
//
// README, section 19. Sweeps over the three parts - force, moment about the normal, moment across
// it - each solved exactly, find the regimes; Newton's method on the natural map then ends at
// round-off. Both decrease the same residual.
#include "rolling/rolling_block.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr int kRounds = 60;       // of sweeps and Newton's method
constexpr double kRound = 4e-16;  // of A x and b

Vector2d clipped(const Vector2d& p, double r) {
  const double length = p.norm();
  return length > r ? Vector2d(r / length * p) : p;
}

}  // namespace

Vector2d in_disc(const Matrix2d& B, const Vector2d& h, double r) {
  if (!(r > 0)) return Vector2d::Zero();
  const double trace = B.trace(), least = 1e-14 * trace;
  const auto at = [&](double lambda) {
    const Matrix2d C = B + lambda * Matrix2d::Identity();
    return Vector2d(C.inverse() * h);
  };
  if (B.determinant() > least * trace) {
    const Vector2d y = at(0);
    if (y.norm() <= r) return y;
  }
  // |y(lambda)| = r: 1/|y| is concave and grows, so that Newton's method converges from below.
  double lambda = std::max(0.0, h.norm() / r - trace);
  if (!(lambda > least)) lambda = least;
  for (int k = 0; k < 60; ++k) {
    const Matrix2d inverse = (B + lambda * Matrix2d::Identity()).inverse();
    const Vector2d y = inverse * h;
    const double length = y.norm(), slope = y.dot(inverse * y);
    if (!(length > r) || !(slope > 0)) break;
    const double step = length * length / slope * (length - r) / r;
    lambda += step;
    if (!(step > 1e-16 * lambda)) break;
  }
  return clipped(at(lambda), r);
}

RollingBlock::RollingBlock(const Matrix6d& matrix, double friction, double torsional,
                           double rolling)
    : A((matrix + matrix.transpose()) / 2),
      forces(Eigen::Matrix3d(A.topLeftCorner<3, 3>()), friction),
      mu(friction),
      spin(torsional),
      roll(rolling) {}

double RollingBlock::residual(const Vector6d& x, const Vector6d& w) const {
  const double a = A(0, 0), t = A.block<2, 2>(1, 1).trace() / 2, s = A(3, 3),
               m = A.block<2, 2>(4, 4).trace() / 2;
  const double n = std::max(0.0, x[0]);
  double most = a * std::abs(x[0] - std::max(0.0, x[0] - w[0] / a));
  const Vector2d xt = x.segment<2>(1), yt = x.segment<2>(4);
  if (t > 0) most = std::max(most, t * (xt - clipped(xt - w.segment<2>(1) / t, mu * n)).norm());
  if (s > 0)
    most = std::max(most, s * std::abs(x[3] - std::clamp(x[3] - w[3] / s, -spin * n, spin * n)));
  if (m > 0) most = std::max(most, m * (yt - clipped(yt - w.segment<2>(4) / m, roll * n)).norm());
  return most;
}

void RollingBlock::sweep(const Vector6d& b, Vector6d& x) const {
  LocalState state;
  for (int k = 0; k < 3; ++k) state.x[k] = x[k];
  solve_local(Law::coulomb, forces, b.head<3>() - A.topRightCorner<3, 3>() * x.tail<3>(), state);
  for (int k = 0; k < 3; ++k) x[k] = state.x[k];
  if (spin > 0 && A(3, 3) > 0) {
    const double h = b[3] - A.row(3).dot(x) + A(3, 3) * x[3];
    x[3] = std::clamp(h / A(3, 3), -spin * x[0], spin * x[0]);
  }
  if (roll > 0) {
    const Matrix2d B = A.block<2, 2>(4, 4);
    const Vector2d h = b.segment<2>(4) - A.block<2, 4>(4, 0) * x.head<4>();
    x.segment<2>(4) = in_disc(B, h, roll * x[0]);
  }
}

// x - P(x - w/d) = 0 by parts, at the regimes of x.
bool RollingBlock::newton_step(const Vector6d& b, Vector6d& x) const {
  const Vector6d w = A * x - b;
  if (!(x[0] - w[0] / A(0, 0) > 0)) return false;
  Matrix6d M = Matrix6d::Zero();
  Vector6d F = Vector6d::Zero();
  M.row(0) = A.row(0);
  F[0] = w[0];
  // A part in rows from `at`, |part| <= bound x_n, d its size.
  const auto put = [&](int at, int size, double bound) {
    const double d = A.block(at, at, size, size).trace() / size;
    Vector2d p = Vector2d::Zero();
    if (bound > 0 && d > 0)
      for (int k = 0; k < size; ++k) p[k] = x[at + k] - w[at + k] / d;
    const double length = p.norm(), r = bound * x[0];
    for (int k = 0; k < size; ++k) {
      if (!(bound > 0 && d > 0)) {  // no friction: 0
        M(at + k, at + k) = A(0, 0);
        F[at + k] = A(0, 0) * x[at + k];
      } else if (length <= r) {
        M.row(at + k) = A.row(at + k);
        F[at + k] = w[at + k];
      } else {
        const double u = p[k] / length;
        M(at + k, at + k) += d;
        M(at + k, 0) -= d * bound * u;
        F[at + k] = d * (x[at + k] - r * u);
        for (int l = 0; l < size; ++l) {
          const double turn = d * r / length * ((k == l ? 1.0 : 0.0) - u * p[l] / length);
          M(at + k, at + l) -= turn;
          M.row(at + k) += turn / d * A.row(at + l);
        }
      }
    }
  };
  put(1, 2, mu);
  put(3, 1, spin);
  put(4, 2, roll);
  const Eigen::FullPivLU<Matrix6d> factors(M);
  const Vector6d step = factors.solve(F);
  if (!step.allFinite()) return false;
  x -= step;
  if (!(x[0] > 0)) return false;
  // Onto the bounds, to the last bit.
  x.segment<2>(1) = clipped(x.segment<2>(1), mu * x[0]);
  x[3] = std::clamp(x[3], -spin * x[0], spin * x[0]);
  x.segment<2>(4) = clipped(x.segment<2>(4), roll * x[0]);
  return true;
}

double RollingBlock::solve(const Vector6d& b, Vector6d& x) const {
  const auto error = [&](const Vector6d& y) { return residual(y, A * y - b); };
  const auto enough = [&](const Vector6d& y) {
    return kRound * (b.cwiseAbs().maxCoeff() + A.cwiseAbs().maxCoeff() * y.cwiseAbs().maxCoeff());
  };
  double best = error(x);
  Vector6d at = x;
  for (int round = 0; round < kRounds && best > enough(x); ++round) {
    for (int k = 0; k < 2 + round; ++k) sweep(b, at);
    if (const double e = error(at); e < best) {
      best = e;
      x = at;
    }
    Vector6d y = at;
    for (int k = 0; k < 8 && best > enough(x); ++k) {
      if (!newton_step(b, y)) break;
      const double e = error(y);
      if (!(e < best)) {
        if (k > 2) break;
        continue;
      }
      best = e;
      x = at = y;
    }
  }
  return best;
}

}  // namespace tether::contact::detail
