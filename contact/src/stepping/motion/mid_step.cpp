// Tether: contacts in the middle of a step. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/motion/mid_step.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

#include "problem/refuse.hpp"
#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

Vector3d relative_velocity(const std::vector<RigidBody>& motion, const PointContact& c) {
  const RigidBody &a = motion[at(c.first)], &b = motion[at(c.second)];
  return a.velocity + a.angular_velocity.cross(c.r1) - b.velocity - b.angular_velocity.cross(c.r2);
}

// By half a step, as the step itself moves it.
void move(std::size_t i, Gyroscopic gyroscopic, double half, BodySet& bodies) {
  RigidBody& b = bodies.motion[i];
  linalg::Quaternion& q = bodies.orientation[i];
  bodies.position[i] += half * b.velocity;
  if (b.angular_velocity.isZero(0)) return;
  if (gyroscopic == Gyroscopic::momentum && !is_isotropic(bodies.inertia[i])) {
    FreeSpin spin;
    turn_with_momentum(bodies.inertia[i], bodies.inverse_inertia[i], half, q, b.angular_velocity,
                       spin);
  } else {
    q = (exponential(half * b.angular_velocity) * q).normalized();
  }
}

}  // namespace

void MidStep::turn(NearContacts& near, const Impacts& impacts, const BodySet& bodies,
                   const JointPart* joints, Gyroscopic gyroscopic, double dt,
                   std::vector<PointContact>& contacts) {
  motion_ = impacts.coming();
  bool any = false;
  const auto held = [&](int body) { return joints != nullptr && joints->holds(body); };
  const auto bend = [&](int body, const Vector3d& r) -> Vector3d {
    if (!held(body)) return Vector3d::Zero();
    const Vector6d& v = joints->bend()[at(body)];
    return v.head<3>() + v.tail<3>().cross(r);
  };
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    if (held(static_cast<int>(i))) motion_[i] = bodies.motion[i];
    any = any || !motion_[i].angular_velocity.isZero(0);
  }
  if (contacts.empty() || !any) return;
  then_ = bodies;
  then_.motion = motion_;
  for (std::size_t i = 0; i < motion_.size(); ++i)
    if (bodies.mass[i] > 0) move(i, gyroscopic, dt / 2, then_);
  near.follow(then_, found_);
  place_.clear();
  for (std::size_t k = 0; k < found_.size(); ++k) {
    check(k, found_[k], static_cast<int>(motion_.size()));
    place_.emplace_back(found_[k].id, k);
  }
  std::sort(place_.begin(), place_.end());
  std::size_t impact = 0;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    if (impact < impacts.list().size() && at(impacts.list()[impact].contact) == k) {
      ++impact;
      continue;
    }
    PointContact& now = contacts[k];
    const auto place =
        std::lower_bound(place_.begin(), place_.end(), std::make_pair(now.id, std::size_t{0}));
    if (place == place_.end() || place->first != now.id) continue;
    const PointContact& then = found_[place->second];
    const Vector3d u = relative_velocity(motion_, now), v = relative_velocity(then_.motion, then);
    // In the middle joints are met to O(dt^2), at the start exactly by the velocities that have not
    // been bent: where bodies that they connect rest on more contacts than they need, differences
    // would choose who carries the load.
    now.bias += held(now.first) || held(now.second)
                    ? now.normal.dot(bend(now.second, now.r2) - bend(now.first, now.r1))
                    : then.normal.dot(v) - now.normal.dot(u);
    now.slip = v - u - now.normal.dot(v - u) * now.normal;
  }
}

}  // namespace tether::contact::detail
