// Tether: units in which the numbers of a scene are near 1. SPDX-License-Identifier: BSD-3-Clause
#include "units.hpp"

#include "effects/list.hpp"
#include "joints/joint_type.hpp"

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
  Largest length;
  for (const effects::Effect* each : effects::all()) each->take_lengths(scene, length);
  // Radii of gyration, and how far the bodies are from each other.
  const Body* first = nullptr;
  for (const Body& body : scene.bodies) {
    if (body.fixed) continue;
    if (body.mass > 0) length.take(std::sqrt(0.5 * body.inertia.trace() / body.mass));
    if (first == nullptr) first = &body;
    length.take((body.position - first->position).norm());
  }
  return length.value();
}

double mass_of(const Scene& scene) {
  double mass = 0;
  for (const Body& body : scene.bodies)
    if (!body.fixed) mass = std::max(mass, body.mass);
  return mass;
}

double time_of(const Scene& scene, double length, double mass) {
  Largest rate;  // 1/s
  for (const effects::Effect* each : effects::all()) each->take_rates(scene, length, mass, rate);
  for (const Body& body : scene.bodies) {
    rate.take(body.velocity.norm() / length);
    rate.take(body.angular_velocity.norm());
  }
  return 1 / rate.value();
}

}  // namespace

Units natural_units(const Scene& scene) {
  const double L = length_of(scene), M = mass_of(scene);
  return {unit_near(L), unit_near(time_of(scene, L, M)), unit_near(M)};
}

Units units_of(const Scene& scene) {
  Units units = natural_units(scene);
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
  for (Body& body : out.bodies) {
    body.mass /= u.mass;
    body.inertia /= u.inertia();
    body.position /= u.length;
    body.velocity /= u.speed();
    body.angular_velocity *= u.time;
  }
  const files::Form form(u);
  for (const effects::Effect* each : effects::all()) {
    each->scene_fields(form, out);
    for (Body& body : out.bodies) each->body_fields(form, body);
    for (Pair& pair : out.pairs) each->pair_fields(form, pair);
    each->fields(form, out);
  }
  for (Joint& joint : out.joints)
    if (joint.closed) joint.closed->position /= u.length;
  if (out.start) {
    out.start->time /= u.time;
    for (BodyState& body : out.start->bodies) from_si(u, body);
  }
  if (out.smooth) out.smooth->max_step /= u.time;
  if (out.event) out.event->max_step /= u.time;
  return out;
}

void from_si(const Units& u, BodyState& body) {
  body.position /= u.length;
  body.velocity /= u.speed();
  body.angular_velocity *= u.time;
}

void to_si(const Units& u, BodyState& body) {
  body.position *= u.length;
  body.velocity *= u.speed();
  body.angular_velocity /= u.time;
}

void to_si(const Units& u, const Scene& scene, scene::Forces& forces) {
  using Of = joints::JointType::MotionOf;
  for (std::size_t j = 0; j < forces.joints.size(); ++j) {
    JointForce& each = forces.joints[j];
    each.drive *= joints::type(scene.joints[j].kind).motion() == Of::angle ? u.energy() : u.force();
    each.force *= u.force();
    each.moment *= u.energy();
    each.at *= u.length;
  }
  for (SpringForce& each : forces.springs) {
    each.tension *= u.force();
    each.tension_second *= u.force();
    each.at *= u.length;
    each.at_second *= u.length;
  }
}

void to_si(const Units& u, Diagnostics& d) {
  d.kinetic_energy *= u.energy();
  d.potential_energy *= u.energy();
  d.momentum *= u.momentum();
  d.angular_momentum *= u.angular_momentum();
}

}  // namespace tether::scene::smooth
