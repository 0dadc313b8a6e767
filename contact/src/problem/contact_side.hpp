// Tether: a contact of two rigid bodies, seen from the one that moves. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <tether/contact/body_solver.hpp>
#include <utility>
#include <vector>

namespace tether::contact::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;

inline Matrix3d skew(const Vector3d& r) {
  Matrix3d X;
  X << 0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0;
  return X;
}

// A contact from the side of a body that moves: `second` is null if the other one does not.
struct Side {
  const RigidBody* first;
  const RigidBody* second;
  Vector3d r1, r2, n;
  Vector3d fixed;  // velocity of the partner at the contact if it does not move, less the slip
  double sign;     // of the caller's impulse
};

inline Side side(const std::vector<RigidBody>& bodies, const PointContact& c, bool turned) {
  Side s{&bodies[static_cast<std::size_t>(c.first)], nullptr, c.r1, c.r2, c.normal, -c.slip, 1};
  const RigidBody* other = c.second < 0 ? nullptr : &bodies[static_cast<std::size_t>(c.second)];
  if (turned) {
    std::swap(s.first, other);
    s.r1.swap(s.r2);
    s.n = -s.n;
    s.fixed = c.slip;
    s.sign = -1;
  }
  if (other && other->moves()) {
    s.second = other;
  } else if (other) {
    s.fixed += other->velocity + other->angular_velocity.cross(s.r2);
  }
  return s;
}

// Velocity of the contact before the impulses, bias included.
inline Vector3d velocity_before(const Side& s, double bias) {
  Vector3d u = s.first->velocity + s.first->angular_velocity.cross(s.r1) - s.fixed + bias * s.n;
  if (s.second) u -= s.second->velocity + s.second->angular_velocity.cross(s.r2);
  return u;
}

// Square of the largest of the velocities of which velocity_before is the sum.
inline double speed_before(const Side& s, double bias) {
  double most = std::max(s.first->velocity.squaredNorm(),
                         s.first->angular_velocity.cross(s.r1).squaredNorm());
  most = std::max({most, s.fixed.squaredNorm(), bias * bias});
  if (!s.second) return most;
  return std::max({most, s.second->velocity.squaredNorm(),
                   s.second->angular_velocity.cross(s.r2).squaredNorm()});
}

// Square of a bound on the speed that an impulse gives to either side of the contact: the mobility
// of a body at r has norm 1/m + |r|^2 tr(I^-1) at most.
inline double speed_by(const Side& s, const Vector3d& p) {
  const auto mobility = [](const RigidBody& b, const Vector3d& r) {
    return b.inverse_mass + r.squaredNorm() * b.inverse_inertia.trace();
  };
  const double first = mobility(*s.first, s.r1);
  const double most = s.second ? std::max(first, mobility(*s.second, s.r2)) : first;
  return most * most * p.squaredNorm();
}

// Diagonal block of A in world axes.
inline Matrix3d diagonal_block(const Side& s) {
  const Matrix3d X = skew(s.r1);
  Matrix3d D = s.first->inverse_mass * Matrix3d::Identity() - X * s.first->inverse_inertia * X;
  if (s.second) {
    const Matrix3d Y = skew(s.r2);
    D += s.second->inverse_mass * Matrix3d::Identity() - Y * s.second->inverse_inertia * Y;
  }
  return D;
}

inline void store(const Vector3d& v, double* out) { Eigen::Map<Vector3d>{out} = v; }
inline Vector3d load(const double* v) { return Eigen::Map<const Vector3d>(v); }

}  // namespace tether::contact::detail
