// Scenes of the stepping tests. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>
#include <tether/contact/stepping.hpp>
#include <utility>
#include <vector>

namespace stepping_scenes {

namespace tc = tether::contact;
using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;
constexpr double kGravity = 9.81;

inline double radians(double degrees) { return degrees * kPi / 180; }

inline Matrix3d box_inertia(double mass, const Vector3d& size) {
  const Vector3d s = size.cwiseProduct(size);
  return mass / 12 * Vector3d(s[1] + s[2], s[0] + s[2], s[0] + s[1]).asDiagonal().toDenseMatrix();
}
inline Matrix3d sphere_inertia(double mass, double radius) {
  return 0.4 * mass * radius * radius * Matrix3d::Identity();
}

// Collects what a Stepper is made of. Material 0: everything; material 1: the ground.
struct Scene {
  tc::BodySet bodies;
  std::vector<tc::Surface> surfaces;
  std::vector<tc::Meeting> meetings;
  tc::SteppingOptions options;

  explicit Scene(double dt = 1e-3) {
    options.step = dt;
    options.gravity = Vector3d(0, 0, -kGravity);
  }
  void friction(double mu, double restitution = 0) {
    meetings = {{0, 0, mu, restitution}, {0, 1, mu, restitution}};
  }
  int ground(const Vector3d& normal = Vector3d::UnitZ()) {
    const int i = bodies.add_fixed(Vector3d::Zero());
    surfaces.push_back({i, tc::Shape::plane(normal), 1});
    return i;
  }
  int sphere(double radius, double mass, const Vector3d& at, const Vector3d& v = Vector3d::Zero(),
             const Vector3d& w = Vector3d::Zero()) {
    const int i = bodies.add(mass, sphere_inertia(mass, radius), at, Quaterniond::Identity(), v, w);
    surfaces.push_back({i, tc::Shape::sphere(radius), 0});
    return i;
  }
  int box(const Vector3d& size, double mass, const Vector3d& at,
          const Quaterniond& q = Quaterniond::Identity()) {
    const int i = bodies.add(mass, box_inertia(mass, size), at, q);
    surfaces.push_back({i, tc::Shape::box(size), 0});
    return i;
  }
  tc::Stepper stepper() const { return tc::Stepper(bodies, surfaces, meetings, options); }
};

inline void run(tc::Stepper& s, double seconds) {
  const long n = std::lround(seconds / s.options().step);
  for (long k = 0; k < n; ++k) s.step();
}

inline const Vector3d& position(const tc::Stepper& s, int i) {
  return s.bodies().position[static_cast<std::size_t>(i)];
}
inline const Vector3d& velocity(const tc::Stepper& s, int i) {
  return s.bodies().motion[static_cast<std::size_t>(i)].velocity;
}
inline const Vector3d& angular_velocity(const tc::Stepper& s, int i) {
  return s.bodies().motion[static_cast<std::size_t>(i)].angular_velocity;
}

}  // namespace stepping_scenes
