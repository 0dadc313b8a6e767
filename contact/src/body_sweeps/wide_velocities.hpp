// Tether: velocities of bodies as long sums of the impulses on them. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <tether/contact/body_solver.hpp>
#include <vector>

namespace tether::contact::detail {

using Wide3 = Eigen::Matrix<long double, 3, 1>;

// Velocities in long sums: impulses on a light body between heavy ones nearly cancel
// (law/exact_error.hpp).
class WideVelocities {
 public:
  explicit WideVelocities(const std::vector<RigidBody>& bodies) : bodies_(bodies) {
    for (const RigidBody& b : bodies) {
      v_.push_back(b.velocity.cast<long double>());
      w_.push_back(b.angular_velocity.cast<long double>());
    }
  }
  void push(const PointContact& c, const Eigen::Vector3d& impulse) {
    const Wide3 p = impulse.cast<long double>();
    push(c.first, c.r1, p);
    if (c.second >= 0) push(c.second, c.r2, -p);
  }
  // Velocity of the first body of a contact against the second one, with the bias.
  Wide3 relative(const PointContact& c) const {
    Wide3 u = at_point(c.first, c.r1) + c.normal.cast<long double>() * c.bias +
              c.slip.cast<long double>();
    if (c.second >= 0) u -= at_point(c.second, c.r2);
    return u;
  }
  Eigen::Vector3d linear(int body) const { return v_[index(body)].cast<double>(); }
  Eigen::Vector3d angular(int body) const { return w_[index(body)].cast<double>(); }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  void push(int body, const Eigen::Vector3d& r, const Wide3& p) {
    const RigidBody& b = bodies_[index(body)];
    v_[index(body)] += b.inverse_mass * p;
    w_[index(body)] += b.inverse_inertia.cast<long double>() * r.cast<long double>().cross(p);
  }
  Wide3 at_point(int body, const Eigen::Vector3d& r) const {
    return v_[index(body)] + w_[index(body)].cross(r.cast<long double>());
  }

  const std::vector<RigidBody>& bodies_;
  std::vector<Wide3> v_, w_;
};

}  // namespace tether::contact::detail
