// Tether: contacts in the middle of a step. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/motion/mid_step.hpp"

#include <limits>
#include <tether/linalg/index.hpp>

#include "joints/stepping/step_joints.hpp"

#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

// By more than the rounding of an orientation.
bool turns(const RigidBody& b, double time) {
  return time * b.angular_velocity.lpNorm<Eigen::Infinity>() >
         std::numeric_limits<double>::epsilon();
}

}  // namespace

// By half a step, as the step itself moves it.
void MidStep::move(int body, const RigidBody& before, const BodySet& bodies, Gyroscopic gyroscopic,
                   double half) {
  const std::size_t i = at(body);
  if (moved_[i] != 0) return;
  moved_[i] = 1;
  RigidBody& b = then_.motion[i];
  b = before;
  then_.position[i] = bodies.position[i];
  then_.orientation[i] = bodies.orientation[i];
  if (!(bodies.mass[i] > 0)) return;
  then_.position[i] += half * b.velocity;
  turn_freely(bodies.inertia[i], bodies.inverse_inertia[i],
              gyroscopic == Gyroscopic::momentum && !is_isotropic(bodies.inertia[i]), half,
              then_.orientation[i], b.angular_velocity);
}

// Points of two surfaces keep their order.
const PointContact* MidStep::find(std::uint64_t id) {
  const std::vector<PointContact>& points = found_.points;
  for (std::size_t k = 0; k < points.size(); ++k, ++next_) {
    if (next_ >= points.size()) next_ = 0;
    if (points[next_].id == id) return &points[next_++];
  }
  return nullptr;
}

void MidStep::turn(NearContacts& near, const Impacts& impacts, const BodySet& bodies,
                   const StepJoints* joints, Gyroscopic gyroscopic, double dt,
                   std::vector<PointContact>& contacts) {
  const std::size_t count = bodies.motion.size();
  const auto held = [&](int body) { return joints != nullptr && joints->holds(body); };
  const auto before = [&](int body) -> const RigidBody& {
    return held(body) ? bodies.motion[at(body)] : impacts.coming()[at(body)];
  };
  const auto bend = [&](int body, const Vector3d& r) -> Vector3d {
    if (!held(body)) return Vector3d::Zero();
    const Vector6d& v = joints->bend[at(body)];
    return v.head<3>() + v.tail<3>().cross(r);
  };
  then_.mass = bodies.mass;
  then_.position.resize(count);
  then_.orientation.resize(count);
  then_.motion.resize(count);
  moved_.assign(count, 0);
  std::uint64_t followed = ~std::uint64_t{0};  // surfaces
  impacts.each_other(contacts.size(), [&](std::size_t k) {
    PointContact& now = contacts[k];
    const RigidBody &a = before(now.first), &b = before(now.second);
    if (!turns(a, dt / 2) && !turns(b, dt / 2)) return;
    if (now.id >> 16 != followed) {
      followed = now.id >> 16;
      move(now.first, a, bodies, gyroscopic, dt / 2);
      move(now.second, b, bodies, gyroscopic, dt / 2);
      near.follow(then_, now, found_);
      next_ = 0;
    }
    const PointContact* then = find(now.id);
    if (then == nullptr) return;
    const Vector3d u = relative_velocity(a, b, now);
    const Vector3d v =
        relative_velocity(then_.motion[at(now.first)], then_.motion[at(now.second)], *then);
    // Joints are met to O(dt^2) in the middle, but exactly at the start. If bodies that joints
    // connect rest on redundant contacts, such differences would decide which contact carries the
    // load.
    now.bias += held(now.first) || held(now.second)
                    ? now.normal.dot(bend(now.second, now.r2) - bend(now.first, now.r1))
                    : then->normal.dot(v) - now.normal.dot(u);
    now.slip += v - u - now.normal.dot(v - u) * now.normal;
  });
}

}  // namespace tether::contact::detail
