// Tether: the motion of bodies in a step, without contacts and joints. SPDX-License-Identifier:
// BSD-3-Clause
#include "stepping/motion/free_motion.hpp"

#include <algorithm>
#include <limits>

#include "joints/stepping/step_joints.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

void FreeMotion::list(const BodySet& bodies, const StepJoints* joints, Gyroscopic gyroscopic) {
  for (std::vector<int>* list : {&moving_, &long_, &free_, &free_round_, &free_long_})
    list->clear();
  spins_.clear();
  may_fall_.assign(bodies.motion.size(), 0);
  falls_ = may_fall_;
  weight_only_.resize(bodies.motion.size());
  for (int i = 0; i < bodies.size(); ++i) {
    if (bodies.mass[at(i)] == 0) continue;
    moving_.push_back(i);
    const bool round = is_isotropic(bodies.inertia[at(i)]);
    if (!round) long_.push_back(i);
    if (joints && joints->holds(i)) continue;
    free_.push_back(i);
    may_fall_[at(i)] = 1;
    (round ? free_round_ : free_long_).push_back(i);
  }
  if (gyroscopic == Gyroscopic::momentum) spins_.resize(free_long_.size());
}

void FreeMotion::accelerate(const Vector3d& dv, BodySet& bodies) const {
  for (const int i : moving_) bodies.motion[at(i)].velocity += dv;
}

void FreeMotion::remember_weight(const BodySet& bodies) {
  for (const int i : moving_) weight_only_[at(i)] = bodies.motion[at(i)].velocity;
}

void FreeMotion::find_falling(const BodySet& bodies) {
  for (const int i : free_)
    falls_[at(i)] = may_fall_[at(i)] != 0 && bodies.motion[at(i)].velocity == weight_only_[at(i)];
}

void FreeMotion::gyrate(Gyroscopic how, double dt, BodySet& bodies) const {
  for (const int i : long_) {
    const Eigen::Matrix3d& inertia = bodies.inertia[at(i)];
    const linalg::Quaternion& q = bodies.orientation[at(i)];
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += how == Gyroscopic::explicit_step
             ? gyroscopic_explicit(inertia, bodies.inverse_inertia[at(i)], q, w, dt)
             : gyroscopic_implicit(inertia, q, w, dt);
  }
}

void FreeMotion::move(double dt, BodySet& bodies) const {
  for (const int i : free_) bodies.position[at(i)] += dt * bodies.motion[at(i)].velocity;
}

void FreeMotion::fall(const Vector3d& gravity, double dt, const StepContacts& contacts,
                      BodySet& bodies) {
  const Vector3d way = -0.5 * dt * dt * gravity;
  if (contacts.points.empty()) {
    for (const int i : free_)
      if (falls(i)) bodies.position[at(i)] += way;
    return;
  }
  islands_.join(bodies, contacts);
  pressed_.assign(bodies.motion.size(), 0);
  const double weight = dt * gravity.norm();
  for (std::size_t k = 0; k < contacts.impulses.size(); ++k) {
    const PointContact& c = contacts.points[k];
    double mass = std::numeric_limits<double>::infinity();
    for (const int body : {c.first, c.second})
      if (bodies.mass[at(body)] > 0) mass = std::min(mass, bodies.mass[at(body)]);
    // By more than rounding.
    if (contacts.impulses[k].norm() > 1e-6 * mass * weight)
      pressed_[at(islands_.root(bodies, c))] = 1;
  }
  for (const int i : free_)
    if (falls(i) && !pressed_[at(islands_.root(i))]) bodies.position[at(i)] += way;
}

void FreeMotion::turn_inertias(BodySet& bodies) const {
  for (const int i : long_)
    bodies.motion[at(i)].inverse_inertia =
        turned(bodies.inverse_inertia[at(i)], bodies.orientation[at(i)]);
}

void FreeMotion::turn_round(double dt, BodySet& bodies) const {
  for (const int i : free_round_) {
    const Vector3d& w = bodies.motion[at(i)].angular_velocity;
    if (w.isZero(0)) continue;
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (exponential(dt * w) * q).normalized();
  }
}

void FreeMotion::turn_plain(double dt, BodySet& bodies) const {
  for (const int i : free_long_) {
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (exponential(dt * b.angular_velocity) * q).normalized();
    b.inverse_inertia = turned(bodies.inverse_inertia[at(i)], q);
  }
}

void FreeMotion::turn_keeping_momentum(double dt, BodySet& bodies) {
  for (std::size_t k = 0; k < free_long_.size(); ++k) {
    const int i = free_long_[k];
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    turn_with_momentum(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)], dt, q,
                       b.angular_velocity, spins_[k]);
    b.inverse_inertia = turned(bodies.inverse_inertia[at(i)], q);
  }
}

}  // namespace tether::contact::detail
