// Mechanisms that touch, for tests of the stepping engine. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <tether/scene/plan.hpp>
#include <vector>

#include "mechanisms.hpp"

namespace jointed_scenes {

using namespace mechanisms;
using namespace tether::scene;

inline const Vector3d kY = Vector3d::UnitY();

inline double radians(double degrees) { return degrees * 3.14159265358979323846 / 180; }

inline Scene stepping(double step, const Vector3d& gravity) {
  Scene s;
  s.stepping.emplace().step = step;
  s.gravity = gravity;
  return s;
}

inline int add(Scene& s, const Body& body) {
  s.bodies.push_back(body);
  return static_cast<int>(s.bodies.size()) - 1;
}

// A half-space of material "ground" behind `at`; everything else is of "part".
inline int add_wall(Scene& s, const Vector3d& at, const Vector3d& normal, double friction,
                    double restitution = 0) {
  Body wall;
  wall.name = "wall " + std::to_string(s.bodies.size());
  wall.fixed = true;
  wall.material = "ground";
  wall.position = at;
  Shape plane;
  plane.kind = ShapeKind::plane;
  plane.normal = normal;
  wall.shapes.push_back(plane);
  s.pairs.clear();
  s.pairs.emplace_back();
  s.pairs.back().first = "part";
  s.pairs.back().second = "ground";
  s.pairs.back().friction = friction;
  s.pairs.back().restitution = restitution;
  return add(s, wall);
}

// Points of the body that touch, in world axes at t = 0.
inline void touch(Body& body, const std::vector<Vector3d>& points) {
  body.material = "part";
  Shape shape;
  shape.kind = ShapeKind::points;
  for (const Vector3d& p : points)
    shape.points.push_back(body.orientation.conjugate() * (p - body.position));
  body.shapes.push_back(shape);
}

inline void touch_sphere(Body& body, double radius) {
  body.material = "part";
  Shape shape;
  shape.kind = ShapeKind::sphere;
  shape.radius = radius;
  body.shapes.push_back(shape);
}

inline double energy(const Engine& engine) {
  const Diagnostics d = engine.diagnostics();
  return d.kinetic_energy + d.potential_energy;
}

// A cart of 10 kg on four hinged discs of 1 kg and 0.2 m, down a slope of 10 degrees.
inline Scene cart(double friction, double step) {
  const double a = radians(10);
  Scene s = stepping(step, kGravity * Vector3d(std::sin(a), 0, -std::cos(a)));
  Body body = ball("cart", {0, 0, 0.4}, 10);
  add(s, body);
  for (int k = 0; k < 4; ++k) {
    const Vector3d hub(k < 2 ? 0.5 : -0.5, k % 2 ? 0.3 : -0.3, 0.2);
    Body disc = ball("disc " + std::to_string(k), hub);
    disc.inertia = Vector3d(0.02, 0.02, 0.02).asDiagonal();
    touch_sphere(disc, 0.2);
    const int d = add(s, disc);
    s.joints.push_back(hinge(d, 0, hub, kY));
  }
  add_wall(s, {0, 0, 0}, Vector3d::UnitZ(), friction);
  return s;
}

// Cranks of 1 m and 1 kg from 60 degrees under a coupler of 2 kg: three of them, one row too many.
// The stop is where they hang down. Every hinge `copies` times.
inline Scene parallelogram(double step, double restitution, int copies) {
  const double a = radians(60);
  Scene s = stepping(step, Vector3d(0, 0, -kGravity));
  const Vector3d arm(std::sin(a), 0, -std::cos(a));
  Body coupler = ball("coupler", Vector3d(1, 0, 0) + arm, 2);
  touch(coupler, {Vector3d(0, 0, 0) + arm});
  add(s, coupler);
  for (int k = 0; k < 3; ++k) {
    const Vector3d pivot(k, 0, 0);
    const int crank = add(s, rod("crank " + std::to_string(k), pivot, pivot + arm));
    for (int c = 0; c < copies; ++c) {
      s.joints.push_back(hinge(crank, kWorld, pivot, kY));
      s.joints.push_back(hinge(0, crank, pivot + arm, kY));
    }
  }
  add_wall(s, {0, 0, 0}, Vector3d::UnitX(), 0, restitution);
  return s;
}

// Two rods of 1 m, a hinge on top, feet on the floor.
inline Scene ladder(double degrees, double friction, double step) {
  const double a = radians(degrees);
  Scene s = stepping(step, Vector3d(0, 0, -kGravity));
  const Vector3d top(0, 0, std::sin(a)), left(-std::cos(a), 0, 0);
  for (const Vector3d& foot : {left, Vector3d(-left)}) {
    Body body = rod(foot.x() < 0 ? "left" : "right", foot, top);
    touch(body, {foot});
    add(s, body);
  }
  s.joints.push_back(hinge(0, 1, top, kY));
  add_wall(s, {0, 0, 0}, Vector3d::UnitZ(), friction);
  return s;
}

}  // namespace jointed_scenes
