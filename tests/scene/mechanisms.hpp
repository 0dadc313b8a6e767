// Jointed scenes with known motions (design/hard_cases.md). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <tether/linalg/shortest_turn.hpp>
#include <tether/scene/engine.hpp>

namespace mechanisms {

using Eigen::Vector3d;
using tether::scene::Body;
using tether::scene::Joint;
using tether::scene::JointKind;
using tether::scene::Scene;
using tether::scene::Spring;

constexpr double kGravity = 9.81;
constexpr int kWorld = -1;

/// A rod from a to b with its own x axis along it; `thin`: inertia along, which plane motions do
/// not feel.
inline Body rod(const std::string& name, const Vector3d& a, const Vector3d& b, double mass = 1,
                double thin = 1e-2) {
  Body body;
  body.name = name;
  body.mass = mass;
  const double across = mass * (b - a).squaredNorm() / 12;
  body.inertia = Vector3d(thin * mass, across, across).asDiagonal();
  body.position = (a + b) / 2;
  body.orientation = tether::linalg::shortest_turn(Vector3d::UnitX(), b - a);
  return body;
}

inline Body ball(const std::string& name, const Vector3d& at, double mass = 1,
                 double inertia = 1e-2) {
  Body body;
  body.name = name;
  body.mass = mass;
  body.inertia = inertia * Eigen::Matrix3d::Identity();
  body.position = at;
  return body;
}

inline Joint hinge(int first, int second, const Vector3d& at,
                   const Vector3d& axis = Vector3d::UnitZ()) {
  Joint joint;
  joint.kind = JointKind::hinge;
  joint.name = "hinge " + std::to_string(first) + " " + std::to_string(second);
  joint.first = first;
  joint.second = second;
  joint.at = at;
  joint.axis = axis;
  return joint;
}

inline Joint joint(JointKind kind, int first, int second, const Vector3d& at,
                   const Vector3d& at_second = Vector3d::Zero()) {
  Joint made = hinge(first, second, at);
  made.kind = kind;
  made.name = "joint " + std::to_string(first) + " " + std::to_string(second);
  made.at_second = at_second;
  return made;
}

inline Scene scene(double tolerance) {
  Scene s;
  s.smooth.emplace().tolerance = tolerance;
  return s;
}

inline void keep_energy(Scene& s) { s.invariants.emplace_back(); }

/// Velocities of a turn about the z axis through `pivot`.
inline void turn_about(Body& body, const Vector3d& pivot, double speed) {
  body.angular_velocity = speed * Vector3d::UnitZ();
  body.velocity = body.angular_velocity.cross(body.position - pivot);
}

/// A rod of length 1 from the horizontal, hinged to the world: phi'' = -g / (2/3) sin phi.
inline Scene pendulum(double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, -kGravity, 0);
  s.bodies.push_back(rod("rod", {0, 0, 0}, {1, 0, 0}));
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0}));
  keep_energy(s);
  return s;
}

/// A02: N + 1 uprights 0 .. N, then N bars; from `angle` to the vertical, clockwise, with `speed`.
inline Scene four_bar(int N, double tolerance, double angle = 0, double speed = 1) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, -kGravity, 0);
  const Vector3d top(std::sin(angle), std::cos(angle), 0), x = Vector3d::UnitX();
  for (int i = 0; i <= N; ++i) {
    s.bodies.push_back(rod("upright " + std::to_string(i), i * x, i * x + top));
    turn_about(s.bodies.back(), i * x, -speed);
    s.joints.push_back(hinge(i, kWorld, i * x));
  }
  for (int i = 0; i < N; ++i) {
    const Vector3d left = i * x + top, right = left + x;
    s.bodies.push_back(rod("bar " + std::to_string(i), left, right));
    s.bodies.back().velocity = speed * Vector3d(top.y(), -top.x(), 0);
    s.joints.push_back(hinge(N + 1 + i, i, left));
    s.joints.push_back(hinge(N + 1 + i, i + 1, right));
  }
  keep_energy(s);
  return s;
}

/// Section 2.1: crank, coupler and slider of 1 kg; the crank is 1 m long, the coupler at least so.
inline Scene slider_crank(double angle, double speed, double gravity, double tolerance,
                          double length = 1) {
  Scene s = scene(tolerance);
  if (gravity != 0) s.gravity = Vector3d(0, -gravity, 0);
  const double c = std::cos(angle), n = std::sin(angle);
  // The coupler goes down by n, along by a; its angle changes by -c / a of the crank's.
  const double a = length == 1 ? c : std::sqrt(length * length - n * n);
  const double turn = length == 1 ? -1 : -c / a, x = c + a;
  s.bodies.push_back(rod("crank", {0, 0, 0}, {c, n, 0}));
  turn_about(s.bodies[0], {0, 0, 0}, speed);
  s.bodies.push_back(rod("coupler", {c, n, 0}, {x, 0, 0}));
  s.bodies[1].velocity = Vector3d(-n + n * turn / 2, c / 2, 0) * speed;
  s.bodies[1].angular_velocity = {0, 0, turn * speed};
  s.bodies.push_back(ball("slider", {x, 0, 0}));
  s.bodies[2].velocity = {(-n + n * turn) * speed, 0, 0};
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0}));
  s.joints.push_back(hinge(1, 0, {c, n, 0}));
  s.joints.push_back(hinge(2, 1, {x, 0, 0}));
  s.joints.push_back(joint(JointKind::slider, 2, kWorld, {x, 0, 0}));
  s.joints.back().axis = {1, 0, 0};
  keep_energy(s);
  return s;
}

/// Two point masses on links of 1 m from the horizontal, by distances in the plane z = 0.
inline Scene double_pendulum(double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, -kGravity, 0);
  s.bodies.push_back(ball("first", {1, 0, 0}));
  s.bodies.push_back(ball("second", {2, 0, 0}));
  s.joints.push_back(joint(JointKind::distance, 0, kWorld, {1, 0, 0}, {0, 0, 0}));
  s.joints.push_back(joint(JointKind::distance, 1, 0, {2, 0, 0}, {1, 0, 0}));
  keep_energy(s);
  return s;
}

/// Five uniform rods of 1 m and 1 kg from the horizontal.
inline Scene chain(int links, double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, -kGravity, 0);
  for (int i = 0; i < links; ++i) {
    s.bodies.push_back(rod("rod " + std::to_string(i), {double(i), 0, 0}, {i + 1.0, 0, 0}));
    s.joints.push_back(hinge(i, i - 1, {double(i), 0, 0}));
  }
  keep_energy(s);
  return s;
}

/// A free body with moments of inertia 1, 2, 3.
inline Scene top(const Vector3d& w, double tolerance) {
  Scene s = scene(tolerance);
  Body body;
  body.name = "top";
  body.mass = 1;
  body.inertia = Vector3d(1, 2, 3).asDiagonal();
  body.angular_velocity = w;
  s.bodies.push_back(body);
  keep_energy(s);
  s.invariants.push_back({tether::scene::InvariantKind::angular_momentum, true, {}});
  return s;
}

/// A04: Bricard's linkage, rods 0 .. 4 between its six hinges.
inline Scene bricard(double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, -kGravity, 0);
  const Vector3d P[6] = {{0, 0, 0}, {1, 0, 0}, {1, -1, 0}, {1, -1, 1}, {0, -1, 1}, {0, 0, 1}};
  const Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), axes[6] = {y, z, x, y, z, x};
  for (int i = 0; i < 5; ++i) {
    Body body = rod("rod " + std::to_string(i), P[i], P[i + 1]);
    body.inertia = Vector3d(1.0 / 600, 1.01 / 12, 1.01 / 12).asDiagonal();
    s.bodies.push_back(body);
  }
  for (int i = 0; i < 6; ++i)
    s.joints.push_back(hinge(i < 5 ? i : 4, i < 5 ? i - 1 : kWorld, P[i], axes[i]));
  keep_energy(s);
  return s;
}

/// A05: flyball governor: shaft, two rods with their balls, slider; z up.
inline Scene governor(double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, 0, -kGravity);
  const double spin = 2 * M_PI, density = 3000, section = 0.01;
  const auto box = [&](const std::string& name, double length, double width) {
    Body body;
    body.name = name;
    body.mass = density * length * width * width;
    const double across = body.mass * (length * length + width * width) / 12;
    body.inertia = Vector3d(body.mass * width * width / 6, across, across).asDiagonal();
    return body;
  };
  Body shaft = box("shaft", 1, section);
  shaft.position = {0, 0, 0.5};
  shaft.orientation = Eigen::AngleAxisd(-M_PI / 2, Vector3d::UnitY());
  shaft.angular_velocity = {0, 0, spin};
  s.bodies.push_back(shaft);
  for (const double side : {1.0, -1.0}) {
    // Outward and 30 degrees down; rod and ball of 5 kg at its end as one body.
    const Vector3d pivot(0.05 * side, 0, 1);
    const Vector3d along(side * std::cos(M_PI / 6), 0, -std::sin(M_PI / 6));
    Body arm = box(side > 0 ? "right arm" : "left arm", 1, section);
    const double m = arm.mass, ball = 5, centre = (m * 0.5 + ball) / (m + ball);
    const double shift = m * (centre - 0.5) * (centre - 0.5) + ball * (1 - centre) * (1 - centre);
    arm.inertia += Vector3d(0, shift, shift).asDiagonal().toDenseMatrix();
    arm.mass = m + ball;
    arm.position = pivot + centre * along;
    arm.orientation = tether::linalg::shortest_turn(Vector3d::UnitX(), along);
    arm.angular_velocity = {0, 0, spin};
    arm.velocity = arm.angular_velocity.cross(arm.position);
    const int index = static_cast<int>(s.bodies.size());
    s.bodies.push_back(arm);
    s.joints.push_back(hinge(index, 0, pivot, Vector3d::UnitY()));
  }
  Body slider = box("slider", 0.1, 0.1);
  slider.position = {0, 0, 0.5};
  slider.angular_velocity = {0, 0, spin};
  s.bodies.push_back(slider);
  s.joints.push_back(joint(JointKind::slider, 3, 0, {0, 0, 0.5}));
  s.joints.push_back(hinge(0, kWorld, {0, 0, 0}));
  for (const double side : {1.0, -1.0}) {
    Spring spring;
    spring.first = 3;
    spring.second = side > 0 ? 1 : 2;
    spring.at = {0.05 * side, 0, 0.5};
    spring.at_second = Vector3d(0.05 * side, 0, 1) +
                       0.5 * Vector3d(side * std::cos(M_PI / 6), 0, -std::sin(M_PI / 6));
    spring.stiffness = 8e5;
    spring.damping = 4e4;
    spring.rest = 0.5;
    s.springs.push_back(spring);
  }
  keep_energy(s);
  s.invariants.push_back({tether::scene::InvariantKind::angular_momentum, true, {}});
  return s;
}

}  // namespace mechanisms
