// Bodies with joints at one instant, solved by what steps use. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cmath>
#include <tether/contact/joints.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "joints/body_cones.hpp"
#include "joints/mechanisms.hpp"

namespace jointed_bodies {

namespace tc = tether::contact;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using tc::Vector6d;

constexpr double kGravity = 9.81;
constexpr int kWorld = -1;

inline double radians(double degrees) { return degrees * 3.14159265358979323846 / 180; }
using tether::linalg::at;

struct JointSolution {
  tc::detail::BodyCones::Result contacts;
  double joint_error = 0;
  tether::linalg::VectorX impulses, joint_impulses;  // contact frame; by row
  std::vector<Vector6d> velocities;
  std::vector<int> contradicting;
};

/// Bodies, rows and contacts in world axes. Each joint gets the next number.
struct Mechanism {
  std::vector<tc::RigidBody> bodies;
  std::vector<Vector3d> centre;
  tc::JointRows rows;
  std::vector<tc::ContactRows> contacts;
  int joints = 0;

  int body(double mass, const Matrix3d& inertia, const Vector3d& where) {
    tc::RigidBody b;
    b.inverse_mass = 1 / mass;
    b.inverse_inertia = inertia.inverse();
    bodies.push_back(b);
    centre.push_back(where);
    return static_cast<int>(bodies.size()) - 1;
  }
  /// A thin rod from p to q in the plane y = 0.
  int rod(double mass, const Vector3d& p, const Vector3d& q) {
    const Vector3d d = q - p;
    const Matrix3d inertia =
        mass / 12 * (d.squaredNorm() * Matrix3d::Identity() - d * d.transpose()) +
        1e-3 * mass * d * d.transpose();
    return body(mass, inertia, (p + q) / 2);
  }
  int fixed(const Vector3d& velocity) {
    bodies.emplace_back();
    bodies.back().velocity = velocity;
    centre.push_back(Vector3d::Zero());
    return static_cast<int>(bodies.size()) - 1;
  }
  /// Velocity of the point p of `first` against `second` along u.
  void along(int first, int second, const Vector3d& p, const Vector3d& u, double rate = 0) {
    rows.add(joints, rate);
    for (const int b : {first, second}) {
      if (b < 0) continue;
      Vector6d G;
      G << u, (p - centre[at(b)]).cross(u);
      rows.on(b, b == first ? G : Vector6d(-G));
    }
  }
  void about(int first, int second, const Vector3d& axis, double rate = 0) {
    rows.add(joints, rate);
    Vector6d G;
    G << Vector3d::Zero(), axis;
    rows.on(first, G);
    rows.on(second, -G);
  }
  void ball(int first, int second, const Vector3d& p) {
    for (int k = 0; k < 3; ++k) along(first, second, p, Vector3d::Unit(k));
    ++joints;
  }
  void hinge(int first, int second, const Vector3d& p, const Vector3d& axis = Vector3d::UnitY()) {
    for (int k = 0; k < 3; ++k) along(first, second, p, Vector3d::Unit(k));
    const Matrix3d F = tc::tangent_frame(axis);
    about(first, second, F.row(1).transpose());
    about(first, second, F.row(2).transpose());
    ++joints;
  }
  /// Moves along `axis` at `rate` against `second`.
  void drive(int first, int second, const Vector3d& axis, double rate) {
    const Matrix3d F = tc::tangent_frame(axis);
    for (int k = 0; k < 3; ++k)
      along(first, second, centre[at(first)], F.row(k).transpose(), k == 0 ? rate : 0);
    for (int k = 0; k < 3; ++k) about(first, second, Vector3d::Unit(k));
    ++joints;
  }
  void touch(int first, int second, const Vector3d& p, const Vector3d& normal, double mu,
             double bias = 0) {
    const Vector3d r2 = second >= 0 ? Vector3d(p - centre[at(second)]) : p;
    contacts.push_back(
        tc::ContactRows::at_point(first, second, p - centre[at(first)], r2, normal, mu));
    contacts.back().bias[0] = bias;
  }
  void fall(double dt, const Vector3d& gravity = Vector3d(0, 0, -kGravity)) {
    for (tc::RigidBody& b : bodies)
      if (b.moves()) b.velocity += dt * gravity;
  }
  /// As a step does: velocities onto the joints, then impulses of the contacts.
  JointSolution solve() const {
    tc::Options options;
    options.law = tc::Law::coulomb;
    options.tolerance = 1e-12;
    JointSolution out;
    tc::detail::Mechanisms mechanisms;
    mechanisms.update(bodies, rows);
    for (const tc::RigidBody& body : bodies) out.velocities.push_back(body.velocities());
    mechanisms.satisfy(rows, out.velocities);
    out.contradicting = mechanisms.contradicting();
    out.impulses.setZero(3 * static_cast<Eigen::Index>(contacts.size()));
    std::vector<tc::detail::BodyCone> cones;
    for (const tc::ContactRows& c : contacts) {
      tc::detail::BodyCone& to = cones.emplace_back(tc::Cone::friction(c.mu));
      to.terms.push_back({c.first, c.J1});
      if (c.second >= 0) to.terms.push_back({c.second, c.J2});
      to.bias = c.bias;
    }
    out.contacts =
        tc::detail::BodyCones(options).solve(mechanisms, cones, out.velocities, out.impulses);
    mechanisms.satisfy(rows, out.velocities);  // removes rounding errors
    out.joint_error = mechanisms.error(rows, out.velocities);
    out.joint_impulses.setZero(rows.count());
    mechanisms.impulses(out.joint_impulses.data());
    return out;
  }
  double energy(const std::vector<Vector6d>& v) const {
    double sum = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (!bodies[i].moves()) continue;
      const Eigen::Matrix<double, 6, 6> M =
          Eigen::Matrix<double, 6, 6>(bodies[i].inverse_mass_matrix()).inverse();
      sum += 0.5 * v[i].dot(M * v[i]);
    }
    return sum;
  }
};

}  // namespace jointed_bodies
