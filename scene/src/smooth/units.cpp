// Tether: units in which the numbers of a scene are near 1. SPDX-License-Identifier: BSD-3-Clause
#include "units.hpp"

#include <algorithm>
#include <cmath>

namespace tether::scene::smooth {

using Eigen::Vector3d;

namespace {

// Binary digits about 1 m, 1 s and 1 kg that need no other units.
constexpr double kOrdinary = 10, kOrdinaryMass = 30;

bool within(double x, double digits) { return std::abs(std::log2(x)) <= digits; }

/// The power of 2 nearest to x; 1 where there is no x.
double unit_near(double x) {
  return x > 0 && std::isfinite(x) ? std::exp2(std::round(std::log2(x))) : 1;
}

double length_of(const Scene& scene) {
  double length = 0;
  const auto arm = [&](int body, const Vector3d& point) {
    if (body < 0) return;
    const Body& b = scene.bodies[static_cast<std::size_t>(body)];
    if (!b.fixed) length = std::max(length, (point - b.position).norm());
  };
  for (const Joint& joint : scene.joints) {
    arm(joint.first, joint.at);
    arm(joint.second, joint.kind == JointKind::distance ? joint.at_second : joint.at);
    if (joint.length) length = std::max(length, *joint.length);
    if (joint.kind == JointKind::distance)
      length = std::max(length, (joint.at - joint.at_second).norm());
    if (joint.motion && joint.kind != JointKind::hinge)
      length = std::max(length, std::abs(joint.motion->amplitude));
  }
  for (const Spring& spring : scene.springs) {
    arm(spring.first, spring.at);
    arm(spring.second, spring.at_second);
    length = std::max(length, (spring.at - spring.at_second).norm());
  }
  // Their radii of gyration, and how far they are from each other.
  const Body* first = nullptr;
  for (const Body& body : scene.bodies) {
    if (body.fixed) continue;
    if (body.mass > 0) length = std::max(length, std::sqrt(0.5 * body.inertia.trace() / body.mass));
    if (first == nullptr) first = &body;
    length = std::max(length, (body.position - first->position).norm());
  }
  return length;
}

double mass_of(const Scene& scene) {
  double mass = 0;
  for (const Body& body : scene.bodies)
    if (!body.fixed) mass = std::max(mass, body.mass);
  return mass;
}

double time_of(const Scene& scene, double length, double mass) {
  double rate = 0;  // 1/s
  const auto take = [&](double r) {
    if (std::isfinite(r)) rate = std::max(rate, r);
  };
  if (scene.gravity) take(std::sqrt(scene.gravity->norm() / length));
  for (const Body& body : scene.bodies) {
    take(body.velocity.norm() / length);
    take(body.angular_velocity.norm());
  }
  for (const Spring& spring : scene.springs) take(std::sqrt(spring.stiffness / mass));
  for (const Load& load : scene.loads) {
    take(std::sqrt(load.force.norm() / (mass * length)));
    take(std::sqrt(load.torque.norm() / (mass * length * length)));
  }
  for (const Joint& joint : scene.joints) {
    if (!joint.motion) continue;
    take(joint.motion->frequency);
    take(std::abs(joint.motion->rate) / (joint.kind == JointKind::hinge ? 1 : length));
  }
  return 1 / rate;
}

}  // namespace

Units units_of(const Scene& scene) {
  const double L = length_of(scene), M = mass_of(scene);
  Units units{unit_near(L), unit_near(time_of(scene, L, M)), unit_near(M)};
  // Tolerances that are absolute in SI serve them, in positions and in velocities.
  const bool ordinary = within(units.length, kOrdinary) && within(units.time, kOrdinary) &&
                        within(units.speed(), kOrdinary);
  if (ordinary) units.length = units.time = 1;
  if (ordinary && within(units.mass, kOrdinaryMass)) units.mass = 1;
  return units;
}

Scene in_units(const Scene& scene, const Units& u) {
  Scene out = scene;
  out.output = Output{};
  out.expect.clear();
  const double acceleration = u.speed() / u.time, stiffness = u.force() / u.length,
               inertia = u.mass * u.length * u.length;
  if (out.gravity) *out.gravity /= acceleration;
  for (Body& body : out.bodies) {
    body.mass /= u.mass;
    body.inertia /= inertia;
    body.position /= u.length;
    body.velocity /= u.speed();
    body.angular_velocity *= u.time;
    if (!body.drag) continue;
    body.drag->linear /= u.force() / u.speed();
    body.drag->quadratic /= u.mass / u.length;
    body.drag->rotational /= inertia / u.time;
  }
  for (Joint& joint : out.joints) {
    joint.at /= u.length;
    joint.at_second /= u.length;
    if (joint.length) *joint.length /= u.length;
    if (!joint.motion) continue;
    const double way = joint.kind == JointKind::hinge ? 1 : u.length;
    joint.motion->rate /= way / u.time;
    joint.motion->amplitude /= way;
    joint.motion->frequency *= u.time;
  }
  for (Spring& spring : out.springs) {
    spring.at /= u.length;
    spring.at_second /= u.length;
    spring.stiffness /= stiffness;
    spring.damping /= stiffness * u.time;
    if (spring.rest) *spring.rest /= u.length;
  }
  for (Load& load : out.loads) {
    load.force /= u.force();
    load.torque /= u.energy();
  }
  if (out.smooth) out.smooth->max_step /= u.time;
  return out;
}

void to_si(const Units& u, BodyState& body) {
  body.position *= u.length;
  body.velocity *= u.speed();
  body.angular_velocity /= u.time;
}

void to_si(const Units& u, Diagnostics& d) {
  d.kinetic_energy *= u.energy();
  d.potential_energy *= u.energy();
  d.momentum *= u.momentum();
  d.angular_momentum *= u.angular_momentum();
}

}  // namespace tether::scene::smooth
