// Tether: large islands at rest and moved. SPDX-License-Identifier: BSD-3-Clause
#include "islands/moved_islands.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tether/contact/stepping.hpp>
#include <utility>

#include "brick_wall.hpp"

namespace tether::contact::random {
namespace {

using Eigen::Vector3d;

constexpr double kStep = 5e-3, kGravity = 9.81;      // s, m/s^2
constexpr double kSpeed = 0.5, kAngularSpeed = 0.5;  // of random velocities, m/s and rad/s
constexpr double kHit = 0.01;                        // share of the bodies that are hit

constexpr double kRadius = 0.5;  // of the spheres of a heap, m

// Spheres settle from a cubic lattice in a box of its width, with drag, for two seconds.
Stepper falling_spheres(int spheres, std::uint64_t seed) {
  constexpr double kPitch = 2.04 * kRadius, kJitter = 0.01, kFriction = 0.3, kDrag = 1, kSpin = 4;
  Generator g(seed);
  const int side = std::max(2, static_cast<int>(std::cbrt(static_cast<double>(spheres))));
  const double width = side * kPitch;
  BodySet bodies;
  std::vector<Surface> surfaces;
  const auto plane = [&](const Vector3d& at, const Vector3d& normal) {
    surfaces.push_back({bodies.add_fixed(at), Shape::plane(normal), 1});
  };
  plane(Vector3d::Zero(), Vector3d::UnitZ());
  for (int axis = 0; axis < 2; ++axis) {
    plane(Vector3d::Zero(), Vector3d::Unit(axis));
    plane(width * Vector3d::Unit(axis), -Vector3d::Unit(axis));
  }
  const Eigen::Matrix3d inertia = 0.4 * kRadius * kRadius * Eigen::Matrix3d::Identity();
  for (int k = 0; k < spheres; ++k) {
    const Vector3d cell(k % side + 0.5, k / side % side + 0.5, k / (side * side) + 0.5);
    surfaces.push_back(
        {bodies.add(1, inertia, kPitch * cell + kJitter * g.vector()), Shape::sphere(kRadius), 0});
  }
  SteppingOptions o;
  o.step = kStep;
  o.gravity = Vector3d(0, 0, -kGravity);
  o.tolerance = 1e-4;
  o.max_sweeps = 60;
  o.max_assembled = 0;
  Stepper stepper(std::move(bodies), std::move(surfaces),
                  {{0, 0, kFriction, 0}, {0, 1, kFriction, 0}}, o);
  stepper.add_force("drag", [](BodySet& all, double, double dt) {
    for (RigidBody& b : all.motion) {
      b.velocity *= std::exp(-kDrag * dt);
      b.angular_velocity *= std::exp(-kSpin * dt);
    }
  });
  return stepper;
}

// Bodies and contacts of the last step; fixed bodies become the world.
Packing settled(int spheres, double mu, std::uint64_t seed) {
  constexpr int kSteps = 400;
  Stepper stepper = falling_spheres(spheres, seed);
  for (int k = 0; k < kSteps; ++k) stepper.step();
  Packing out;
  std::vector<int> place;
  for (const RigidBody& b : stepper.bodies().motion) {
    place.push_back(b.moves() ? static_cast<int>(out.bodies.size()) : -1);
    if (b.moves()) out.bodies.push_back(b);
  }
  for (PointContact c : stepper.contacts().points) {
    const auto at = [&](int body) { return body < 0 ? -1 : place[static_cast<std::size_t>(body)]; };
    c.first = at(c.first);
    c.second = at(c.second);
    if (c.first < 0) {
      std::swap(c.first, c.second);
      std::swap(c.r1, c.r2);
      c.normal = -c.normal;
    }
    c.mu = mu;
    out.contacts.push_back(c);
  }
  return out;
}

Packing lattice(bool spheres, int contacts, double mu, std::uint64_t seed) {
  Packing out = packing(static_cast<int>(std::lround(std::cbrt(contacts / 3.0))), spheres, seed);
  for (PointContact& c : out.contacts) c.mu = mu;
  return out;
}

void move(Motion motion, std::uint64_t seed, Packing& island) {
  Generator g(seed + 1);
  for (RigidBody& b : island.bodies) {
    const bool hit = g.uniform(0, 1) < kHit;
    const Vector3d v = kSpeed * g.vector(), w = kAngularSpeed * g.vector();
    const bool moved = motion == Motion::shaken || (motion == Motion::hit && hit);
    b.velocity = Vector3d(0, 0, -kGravity * kStep);
    if (moved) b.velocity += v;
    b.angular_velocity = moved ? w : Vector3d::Zero();
  }
}

}  // namespace

Motion motion(const std::string& name) {
  static const std::map<std::string, Motion> known = {
      {"rest", Motion::rest}, {"hit", Motion::hit}, {"shaken", Motion::shaken}};
  const auto found = known.find(name);
  if (found == known.end())
    throw std::invalid_argument("motion \"" + name + "\": must be rest, hit or shaken");
  return found->second;
}

const std::vector<std::string>& families() {
  static const std::vector<std::string> names = {"heap", "spheres", "bodies", "packing", "wall"};
  return names;
}

Packing moved_island(const std::string& family, int contacts, double mu, Motion motion,
                     std::uint64_t seed) {
  // Contacts of a body; a packing has four bodies a cell.
  constexpr double kInHeap = 2.5, kInPacking = 4 * 2.65, kInWall = 11.5;
  Packing out;
  if (family == "heap") {
    out = settled(static_cast<int>(contacts / kInHeap), mu, seed);
  } else if (family == "spheres" || family == "bodies") {
    out = lattice(family == "spheres", contacts, mu, seed);
  } else if (family == "packing") {
    out = close_packing(static_cast<int>(std::lround(std::cbrt(contacts / kInPacking))), false, mu,
                        seed);
  } else if (family == "wall") {
    const int side = std::max(2, static_cast<int>(std::lround(std::sqrt(contacts / kInWall))));
    out = BrickWall(side, side, mu).packing();
  } else {
    throw std::invalid_argument("family \"" + family +
                                "\": must be heap, spheres, bodies, packing or wall");
  }
  move(motion, seed, out);
  return out;
}

}  // namespace tether::contact::random
