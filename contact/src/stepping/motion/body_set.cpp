// Tether: sets of bodies. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <stdexcept>
#include <string>
#include <tether/contact/stepping.hpp>

#include "stepping/motion/rotation.hpp"

namespace tether::contact {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

void check_place(const Vector3d& at, const linalg::Quaternion& turned) {
  if (!at.allFinite() || !turned.coeffs().allFinite() || !(turned.norm() > 0))
    throw std::invalid_argument("a body needs a finite position and a quaternion that is not zero");
}

}  // namespace

int BodySet::add(double body_mass, const Matrix3d& body_inertia, const Vector3d& at,
                 const linalg::Quaternion& turned, const Vector3d& velocity,
                 const Vector3d& angular_velocity) {
  check_place(at, turned);
  if (!(body_mass > 0) || !std::isfinite(body_mass) || !body_inertia.allFinite() ||
      !velocity.allFinite() || !angular_velocity.allFinite())
    throw std::invalid_argument("a body needs a mass > 0 and finite values");
  const Matrix3d I = 0.5 * (body_inertia + body_inertia.transpose());
  if (Eigen::LLT<Matrix3d>(I).info() != Eigen::Success)
    throw std::invalid_argument("the inertia of a body must be positive definite");
  const bool isotropic = detail::is_isotropic(I);
  position.push_back(at);
  orientation.push_back(turned.normalized());
  mass.push_back(body_mass);
  // Exactly a multiple of 1, so that contacts of spheres are recognised.
  inertia.push_back(isotropic ? Matrix3d(I.trace() / 3 * Matrix3d::Identity()) : I);
  inverse_inertia.push_back(isotropic ? Matrix3d(3 / I.trace() * Matrix3d::Identity())
                                      : Matrix3d(I.inverse()));
  RigidBody body;
  body.inverse_mass = 1 / body_mass;
  body.inverse_inertia = isotropic ? inverse_inertia.back()
                                   : detail::turned(inverse_inertia.back(), orientation.back());
  body.velocity = velocity;
  body.angular_velocity = angular_velocity;
  motion.push_back(body);
  return size() - 1;
}

int BodySet::add_fixed(const Vector3d& at, const linalg::Quaternion& turned) {
  check_place(at, turned);
  position.push_back(at);
  orientation.push_back(turned.normalized());
  mass.push_back(0);
  inertia.push_back(Matrix3d::Zero());
  inverse_inertia.push_back(Matrix3d::Zero());
  motion.push_back({});
  return size() - 1;
}

double kinetic_energy(const BodySet& bodies) {
  double sum = 0;
  for (std::size_t i = 0; i < bodies.position.size(); ++i) {
    const RigidBody& b = bodies.motion[i];
    const Vector3d w = bodies.orientation[i].conjugate() * b.angular_velocity;
    sum += bodies.mass[i] * b.velocity.squaredNorm() + w.dot(bodies.inertia[i] * w);
  }
  return sum / 2;
}

Vector3d momentum(const BodySet& bodies) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < bodies.position.size(); ++i)
    sum += bodies.mass[i] * bodies.motion[i].velocity;
  return sum;
}

Vector3d angular_momentum(const BodySet& bodies) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < bodies.position.size(); ++i) {
    const RigidBody& b = bodies.motion[i];
    sum += bodies.mass[i] * bodies.position[i].cross(b.velocity) +
           detail::spin(bodies.inertia[i], bodies.orientation[i], b.angular_velocity);
  }
  return sum;
}

}  // namespace tether::contact
