// Tether: rotation of one rigid body over one step. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/motion/rotation.hpp"

#include <Eigen/LU>
#include <cmath>

#include "problem/contact_side.hpp"

namespace tether::contact::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// d exp(phi) = (jacobian d phi) x exp(phi).
Matrix3d left_jacobian(const Vector3d& phi) {
  const double a2 = phi.squaredNorm(), a = std::sqrt(a2);
  const Matrix3d X = skew(phi);
  if (a < 1e-4) return Matrix3d::Identity() + 0.5 * X + X * X / 6;
  return Matrix3d::Identity() + (1 - std::cos(a)) / a2 * X + (a - std::sin(a)) / (a2 * a) * X * X;
}

// Newton on I W1 = exp(-dt (W + W1) / 2) I W. False if it does not converge.
bool solve_step(const Matrix3d& I, const Vector3d& W, double dt, Vector3d& W1) {
  const Vector3d M = I * W;
  W1 = W;
  double last = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Vector3d phi = -0.5 * dt * (W + W1);
    const Vector3d M1 = exponential(phi) * M;
    const Matrix3d slope = I - 0.5 * dt * skew(M1) * left_jacobian(phi);
    const Vector3d move = slope.inverse() * (M1 - I * W1);
    W1 += move;
    const double size = move.norm();
    // Quadratic: a move of 1e-9 leaves 1e-16 or so.
    if (size <= 1e-15 * W1.norm() || (size <= 1e-9 * W1.norm() && size >= 0.5 * last)) return true;
    if (!(size <= last) && iteration > 3) return false;
    last = size;
  }
  return last <= 1e-13 * W1.norm();
}

void turn(const Matrix3d& I, double dt, int depth, linalg::Quaternion& q, Vector3d& W) {
  Vector3d W1;
  if (solve_step(I, W, dt, W1) || depth == 0) {
    q = (q * exponential(0.5 * dt * (W + W1))).normalized();
    W = W1;
    return;
  }
  // Rotations of several radians a step: the momentum is constant, so parts of the step compose.
  turn(I, dt / 2, depth - 1, q, W);
  turn(I, dt / 2, depth - 1, q, W);
}

}  // namespace

bool is_isotropic(const Matrix3d& I) {
  const double mean = I.trace() / 3;
  return (I - mean * Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 1e-14 * std::abs(mean);
}

Matrix3d turned(const Matrix3d& tensor, const linalg::Quaternion& q) {
  // Without rounding: a body read from a saved state has the tensor itself.
  if (tensor == tensor(0, 0) * Matrix3d::Identity()) return tensor;
  const Matrix3d R = q.toRotationMatrix();
  const Matrix3d out = R * tensor * R.transpose();
  return 0.5 * (out + out.transpose());
}

Vector3d spin(const Matrix3d& inertia, const linalg::Quaternion& q, const Vector3d& w) {
  return q * (inertia * (q.conjugate() * w));
}

linalg::Quaternion exponential(const Vector3d& rotation) {
  const double a2 = rotation.squaredNorm(), a = std::sqrt(a2);
  // sin(a/2)/a by its series where the quotient would lose digits.
  const double s = a < 1e-3 ? 0.5 - a2 / 48 + a2 * a2 / 3840 : std::sin(0.5 * a) / a;
  return {std::cos(0.5 * a), s * rotation[0], s * rotation[1], s * rotation[2]};
}

void turn_with_velocity(const Vector3d& rotation, linalg::Quaternion& q, Vector3d& w) {
  const linalg::Quaternion by = exponential(rotation);
  q = (by * q).normalized();
  w = by * w;
}

Vector3d gyroscopic_explicit(const Matrix3d& inertia, const Matrix3d& inverse_inertia,
                             const linalg::Quaternion& q, const Vector3d& w, double dt) {
  const Vector3d W = q.conjugate() * w;
  return -dt * (q * (inverse_inertia * W.cross(inertia * W)));
}

Vector3d gyroscopic_implicit(const Matrix3d& inertia, const linalg::Quaternion& q,
                             const Vector3d& w, double dt) {
  const Vector3d W = q.conjugate() * w, M = inertia * W;
  // f(W1) = I (W1 - W) + dt W1 x I W1 = 0, one Newton step from W.
  const Matrix3d slope = inertia + dt * (skew(W) * inertia - skew(M));
  return -(q * (slope.inverse() * (dt * W.cross(M))));
}

void turn_with_momentum(const Matrix3d& inertia, const Matrix3d& inverse_inertia, double dt,
                        linalg::Quaternion& q, Vector3d& w, StepperMemory::Spin& kept) {
  if (w.isZero(0)) return;
  const bool same = w == kept.angular_velocity && q.coeffs() == kept.orientation.coeffs();
  if (!same) kept.momentum = spin(inertia, q, w);
  Vector3d W = inverse_inertia * (q.conjugate() * kept.momentum);
  turn(inertia, dt, 8, q, W);
  w = q * (inverse_inertia * (q.conjugate() * kept.momentum));
  kept.angular_velocity = w;
  kept.orientation = q;
}

}  // namespace tether::contact::detail
