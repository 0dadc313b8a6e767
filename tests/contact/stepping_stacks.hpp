// Assemblies of polyhedra that stand or fall. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <limits>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace stepping_scenes {

// Ten cubes of 1 m, the top one of another mass.
inline Scene stack(double dt, double top_mass, double mu = 0.5, int n = 10) {
  Scene scene(dt);
  scene.friction(mu);
  scene.ground();
  for (int k = 0; k < n; ++k)
    scene.box(Vector3d::Ones(), k + 1 == n ? top_mass : 1, Vector3d(0, 0, k + 0.5));
  return scene;
}

// Three levels of 15 cards (L = 1, t = 0.02, half width 0.35, 1 kg), lean 15 degrees from the
// vertical, apexes 1.02 apart, flats of length 1. A leaning card stands on its lower inner edge;
// the top inner edges touch; flats lie on the upper edges. Static for mu >= 0.2376138.
inline Scene card_house(double dt, double mu, int levels = 3, double lean_degrees = 15) {
  Scene scene(dt);
  scene.friction(mu);
  scene.ground();
  const double L = 1, t = 0.02, lean = radians(lean_degrees), spacing = 1.02;
  const double c = std::cos(lean), s = std::sin(lean);
  const Vector3d card(t, 0.7, L), flat(1, 0.7, t);
  double floor = 0, left = 0;  // of this level, and its first apex
  for (int level = levels; level >= 1; --level) {
    for (int k = 0; k < level; ++k) {
      const double apex = left + k * spacing;
      for (const int side : {-1, 1}) {
        // The inner face of the card goes through apex and foot edge; its middle is t / 2 outside.
        const Vector3d middle(apex + side * (0.5 * L * s + 0.5 * t * c), 0,
                              floor + 0.5 * L * c + 0.5 * t * s);
        scene.box(card, 1, middle, Quaterniond(AngleAxisd(-side * lean, Vector3d::UnitY())));
      }
    }
    const double top = floor + L * c + t * s;  // of the upper edges
    for (int k = 0; k + 1 < level; ++k)
      scene.box(flat, 1, Vector3d(left + (k + 0.5) * spacing, 0, top + 0.5 * t));
    floor = top + t;
    left += 0.5 * spacing;
  }
  return scene;
}

// A semicircular arch of n voussoirs between radial joints, mean radius 1, depth 0.3, on two fixed
// stones. `arcs`: mass and centre of the sector of a ring; else of the polygon.
inline Scene arch(double dt, int n, double thickness, double mu, bool arcs = true) {
  Scene scene(dt);
  scene.friction(mu);
  const double inner = 1 - thickness / 2, outer = 1 + thickness / 2, depth = 0.3;
  const double step = kPi / n;
  const auto corners = [&](double from, double to) {
    std::vector<Vector3d> points;
    for (const double angle : {from, to})
      for (const double r : {inner, outer})
        for (const double y : {-depth / 2, depth / 2})
          points.emplace_back(-r * std::cos(angle), y, r * std::sin(angle));
    return points;
  };
  const auto centred = [](std::vector<Vector3d> points, const Vector3d& at) {
    for (Vector3d& p : points) p -= at;
    return points;
  };
  for (int k = 0; k < n; ++k) {
    const double middle = (k + 0.5) * step, half = step / 2;
    double radius, area;
    if (arcs) {
      area = half * (outer * outer - inner * inner);
      radius = 2.0 / 3 * std::sin(half) / half * (std::pow(outer, 3) - std::pow(inner, 3)) /
               (outer * outer - inner * inner);
    } else {
      area = 0.5 * std::sin(step) * (outer * outer - inner * inner);
      radius = std::cos(half) * 2.0 / 3 * (std::pow(outer, 3) - std::pow(inner, 3)) /
               (outer * outer - inner * inner);
    }
    const double mass = 2000 * area * depth;
    const Vector3d at(-radius * std::cos(middle), 0, radius * std::sin(middle));
    const Vector3d size(thickness, depth, step);
    const int body = scene.bodies.add(mass, box_inertia(mass, size), at, Quaterniond::Identity());
    scene.surfaces.push_back(
        {body, tc::Shape::convex(centred(corners(k * step, (k + 1) * step), at)), 0});
  }
  for (const double angle : {0.0, kPi}) {
    const Vector3d at(-std::cos(angle), 0, -0.25);
    const int body = scene.bodies.add_fixed(at);
    scene.surfaces.push_back({body, tc::Shape::box(Vector3d(2 * thickness, 2 * depth, 0.5)), 0});
  }
  return scene;
}

inline double largest_move(const tc::Stepper& s, const tc::BodySet& start) {
  double most = 0;
  for (std::size_t i = 0; i < start.position.size(); ++i)
    most = std::max(most, (s.bodies().position[i] - start.position[i]).norm());
  return most;
}

inline double largest_speed(const tc::Stepper& s) {
  double most = 0;
  for (const tc::RigidBody& b : s.bodies().motion)
    most = std::max({most, b.velocity.norm(), b.angular_velocity.norm()});
  return most;
}

// A structure that stands has no velocity after one step, one that falls takes up a good part of
// what gravity adds: ten orders lie between them.
inline bool stands(const Scene& scene) {
  tc::Stepper s = scene.stepper();
  s.step();
  CHECK(s.status() == tc::Status::solved);
  return largest_speed(s) < 1e-7 * kGravity * scene.options.step;
}

}  // namespace stepping_scenes
