// Tether: bodies in world axes, with derivatives by automatic differentiation.
// SPDX-License-Identifier: BSD-3-Clause
//
// Directions of differentiation of one body, 12: its position, a small turn in its own axes
// (R -> R (1 + [turn]x)), its velocity, its angular velocity in its own axes. A pair has 24.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <tether/linalg/index.hpp>
#include <unsupported/Eigen/AutoDiff>

#include "lists.hpp"

namespace tether::scene::mechanics {

using linalg::at;

using Eigen::Matrix3d;
using Eigen::Vector3d;
template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;
template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;

constexpr int kBodyDirections = 12;
using Derivatives = Eigen::Matrix<double, 2 * kBodyDirections, 1>;
using Dual = Eigen::AutoDiffScalar<Derivatives>;

inline double value_of(double x) { return x; }
inline double value_of(const Dual& x) { return x.value(); }

// Plain loops of three: Eigen's products of AutoDiffScalars keep references to temporaries.
template <class S>
Vector3<S> cross(const Vector3<S>& a, const Vector3<S>& b) {
  return {S(a[1] * b[2] - a[2] * b[1]), S(a[2] * b[0] - a[0] * b[2]), S(a[0] * b[1] - a[1] * b[0])};
}
template <class S, class T>
S dot(const Vector3<S>& a, const Vector3<T>& b) {
  S sum = a[0] * b[0];
  sum += a[1] * b[1];
  sum += a[2] * b[2];
  return sum;
}
template <class S, class T>
Vector3<S> times(const Matrix3<S>& R, const Vector3<T>& u) {
  Vector3<S> out;
  for (int i = 0; i < 3; ++i) {
    out[i] = R(i, 0) * u[0];
    out[i] += R(i, 1) * u[1];
    out[i] += R(i, 2) * u[2];
  }
  return out;
}
template <class S>
Vector3<S> transposed_times(const Matrix3<S>& R, const Vector3<S>& u) {
  Vector3<S> out;
  for (int i = 0; i < 3; ++i) {
    out[i] = R(0, i) * u[0];
    out[i] += R(1, i) * u[1];
    out[i] += R(2, i) * u[2];
  }
  return out;
}

/// Centre, attitude, velocities and accelerations in world axes.
template <class S>
struct Frame {
  Vector3<S> x, v, W, a, alpha;
  Matrix3<S> R;
};

/// A body at rest.
inline Frame<double> frame_at(const Vector3d& position, const Matrix3d& R) {
  Frame<double> f;
  f.v = f.W = f.a = f.alpha = Vector3d::Zero();
  f.x = position;
  f.R = R;
  return f;
}

inline Matrix3d skew(const Vector3d& u) {
  Matrix3d K;
  K << 0, -u.z(), u.y(), u.z(), 0, -u.x(), -u.y(), u.x(), 0;
  return K;
}

/// The frame of a body with its derivatives in directions first .. first + 11. Accelerations are
/// constants: v' in world axes, w' in body axes.
inline Frame<Dual> seed(const Frame<double>& f, bool moving, int first) {
  Frame<Dual> out;
  const auto constant = [](const Vector3d& u) {
    return Vector3<Dual>(Dual(u[0]), Dual(u[1]), Dual(u[2]));
  };
  out.x = constant(f.x);
  out.v = constant(f.v);
  out.a = constant(f.a);
  for (int i = 0; i < 9; ++i) out.R(i) = Dual(f.R(i));
  if (!moving) {
    out.W = constant(f.W);
    out.alpha = constant(f.alpha);
    return out;
  }
  for (int k = 0; k < 3; ++k) {
    out.x[k].derivatives()[first + k] = 1.0;
    out.v[k].derivatives()[first + 6 + k] = 1.0;
    const Matrix3d dR = f.R * skew(Vector3d::Unit(k));
    for (int i = 0; i < 9; ++i) out.R(i).derivatives()[first + 3 + k] = dR(i);
  }
  Vector3<Dual> w = constant(f.R.transpose() * f.W);
  for (int k = 0; k < 3; ++k) w[k].derivatives()[first + 9 + k] = 1.0;
  out.W = times(out.R, w);
  out.alpha = times(out.R, Vector3d(f.R.transpose() * f.alpha));
  return out;
}

/// A vector with its first and second time derivative.
template <class S>
struct Jet {
  Vector3<S> x, x1, x2;
};

template <int order, class S>
Jet<S> direction(const Frame<S>& f, const Vector3d& local) {
  Jet<S> u;
  u.x = times(f.R, local);
  if constexpr (order >= 1) u.x1 = cross(f.W, u.x);
  if constexpr (order >= 2) {
    u.x2 = cross(f.alpha, u.x);
    u.x2 += cross(f.W, u.x1);
  }
  return u;
}

template <int order, class S>
Jet<S> point(const Frame<S>& f, const Vector3d& local) {
  Jet<S> u = direction<order>(f, local);
  u.x += f.x;
  if constexpr (order >= 1) u.x1 += f.v;
  if constexpr (order >= 2) u.x2 += f.a;
  return u;
}

/// The way from a point of B to one of A.
template <int order, class S>
Jet<S> between(const Frame<S>& A, const Vector3d& at_a, const Frame<S>& B, const Vector3d& at_b) {
  Jet<S> d = point<order>(A, at_a);
  const Jet<S> b = point<order>(B, at_b);
  d.x -= b.x;
  if constexpr (order >= 1) d.x1 -= b.x1;
  if constexpr (order >= 2) d.x2 -= b.x2;
  return d;
}

/// The order-th derivative of u . v.
template <int order, class S>
S product(const Jet<S>& u, const Jet<S>& v) {
  if constexpr (order == 0) {
    return dot(u.x, v.x);
  } else if constexpr (order == 1) {
    S sum = dot(u.x1, v.x);
    sum += dot(u.x, v.x1);
    return sum;
  } else {
    S sum = dot(u.x1, v.x1);
    sum += sum;
    sum += dot(u.x2, v.x);
    sum += dot(u.x, v.x2);
    return sum;
  }
}

/// A direction that moves in the axes of the body: local, its rate and second rate.
template <int order, class S>
Jet<S> moving_direction(const Frame<S>& f, const Vector3d& local, const Vector3d& local1,
                        const Vector3d& local2) {
  Jet<S> u;
  u.x = times(f.R, local);
  if constexpr (order >= 1) {
    const Vector3<S> relative = times(f.R, local1);
    const Vector3<S> carried = cross(f.W, u.x);
    u.x1 = carried + relative;
    if constexpr (order >= 2) {
      u.x2 = cross(f.alpha, u.x);
      u.x2 += cross(f.W, carried);
      const Vector3<S> coriolis = cross(f.W, relative);
      u.x2 += coriolis;
      u.x2 += coriolis;
      u.x2 += times(f.R, local2);
    }
  }
  return u;
}

/// Force and torque about the centre, world axes.
template <class S>
struct Wrench {
  Vector3<S> force, torque;

  void add(const Frame<S>& f, const Vector3<S>& at, const Vector3<S>& pull) {
    force += pull;
    const Vector3<S> arm = at - f.x;
    torque += cross(arm, pull);
  }
};

/// A force on a point of A, and the opposite on one of B.
template <class S>
void add_opposite(const Frame<S>& A, const Vector3<S>& at_a, const Frame<S>& B,
                  const Vector3<S>& at_b, const Vector3<S>& force, Wrench<S>& on_a,
                  Wrench<S>& on_b) {
  on_a.add(A, at_a, force);
  on_b.add(B, at_b, Vector3<S>(-force));
}

template <class S>
Wrench<S> no_wrench() {
  const Vector3<S> zero(S(0.0), S(0.0), S(0.0));
  return {zero, zero};
}

/// R of q / |q|, body to world.
inline Matrix3d rotation(const double* q) {
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

/// q' = q (0, w) / 2, q wxyz, w in body axes.
inline Eigen::Vector4d quaternion_rate(const double* q, const Vector3d& w) {
  return 0.5 * Eigen::Vector4d(-q[1] * w[0] - q[2] * w[1] - q[3] * w[2],
                               q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                               q[0] * w[1] + q[3] * w[0] - q[1] * w[2],
                               q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
}

/// Its derivatives: q' = A(w) q = B(q) w.
inline Eigen::Matrix4d rate_by_quaternion(const Vector3d& w) {
  Eigen::Matrix4d A;
  A << 0, -w[0], -w[1], -w[2],  //
      w[0], 0, w[2], -w[1],     //
      w[1], -w[2], 0, w[0],     //
      w[2], w[1], -w[0], 0;
  return 0.5 * A;
}

inline Eigen::Matrix<double, 4, 3> rate_by_spin(const double* q) {
  Eigen::Matrix<double, 4, 3> B;
  B << -q[1], -q[2], -q[3],  //
      q[0], -q[3], q[2],     //
      q[3], q[0], -q[1],     //
      -q[2], q[1], q[0];
  return 0.5 * B;
}

}  // namespace tether::scene::mechanics
