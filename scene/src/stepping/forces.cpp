// Tether: forces of a scene as stages of a step. SPDX-License-Identifier: BSD-3-Clause
#include "forces.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace tether::scene::stepping {

using contact::BodySet;
using contact::RigidBody;
using Eigen::Vector3d;

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// One end of a spring in world axes.
struct End {
  Vector3d point, arm, velocity;
};

End end(const BodySet& bodies, int body, const Vector3d& where) {
  if (body < 0) return {where, Vector3d::Zero(), Vector3d::Zero()};
  const RigidBody& b = bodies.motion[at(body)];
  const Vector3d arm = bodies.orientation[at(body)] * where;
  return {bodies.position[at(body)] + arm, arm, b.velocity + b.angular_velocity.cross(arm)};
}

void push(BodySet& bodies, int body, const Vector3d& arm, const Vector3d& impulse) {
  if (body < 0) return;
  RigidBody& b = bodies.motion[at(body)];
  b.velocity += b.inverse_mass * impulse;
  b.angular_velocity += b.inverse_inertia * arm.cross(impulse);
}

void pull(const std::vector<AttachedSpring>& springs, BodySet& bodies, double dt) {
  for (const AttachedSpring& s : springs) {
    const End a = end(bodies, s.first, s.at), b = end(bodies, s.second, s.at_second);
    const Vector3d d = b.point - a.point;
    const double length = d.norm();
    if (!(length > 0)) continue;  // no direction
    const Vector3d u = d / length;
    const double tension =
        s.stiffness * (length - s.rest) + s.damping * u.dot(b.velocity - a.velocity);
    push(bodies, s.first, a.arm, dt * tension * u);
    push(bodies, s.second, b.arm, -dt * tension * u);
  }
}

struct Dragged {
  int body;
  Drag drag;
};

// Implicit in the speed, so that any strength is stable: v+ = v / (1 + dt (linear + quadratic |v|)
// / m).
void brake(const std::vector<Dragged>& all, BodySet& bodies, double dt) {
  for (const Dragged& d : all) {
    RigidBody& b = bodies.motion[at(d.body)];
    const double force = d.drag.linear + d.drag.quadratic * b.velocity.norm();
    b.velocity /= 1 + dt * b.inverse_mass * force;
    if (d.drag.rotational == 0) continue;
    // (I + dt c) w+ = I w, in body axes.
    const Eigen::Quaterniond& q = bodies.orientation[at(d.body)];
    const Eigen::Matrix3d& I = bodies.inertia[at(d.body)];
    const Eigen::Matrix3d slowed = I + dt * d.drag.rotational * Eigen::Matrix3d::Identity();
    b.angular_velocity = q * (slowed.inverse() * (I * (q.conjugate() * b.angular_velocity)));
  }
}

// Explicit springs of a semi-implicit step need dt^2 k / m < 4 and dt c / m < 2; together
// dt^2 k + 2 dt c < 4 m.
void check_step(const Scene& scene, const AttachedSpring& s, const Spring& named,
                const BodySet& bodies, double dt) {
  const auto softness = [&](int body, const Vector3d& where) {
    if (body < 0 || bodies.mass[at(body)] == 0) return 0.0;
    // The largest inverse mass of the point in any direction.
    const Eigen::Matrix3d& J = bodies.inverse_inertia[at(body)];
    return 1 / bodies.mass[at(body)] + where.squaredNorm() * J.trace();
  };
  const double inverse = softness(s.first, s.at) + softness(s.second, s.at_second);
  if ((dt * s.stiffness + 2 * s.damping) * dt * inverse < 4) return;
  const double c = 2 * s.damping * inverse, k = s.stiffness * inverse;
  const double most = k > 0 ? (std::sqrt(c * c + 16 * k) - c) / (2 * k) : 4 / c;
  std::ostringstream text;
  text << scene.file << ":" << named.place.line << ": spring \"" << named.name << "\": a step of "
       << dt << " s is too long for it to be stable; stepping.step must be below about " << most
       << " s (or, without contacts, use the smooth engine)";
  throw std::invalid_argument(text.str());
}

}  // namespace

std::vector<AttachedSpring> attach(const Scene& scene) {
  std::vector<AttachedSpring> all;
  const auto in_body = [&](int body, const Vector3d& p) -> Vector3d {
    if (body < 0) return p;
    const Body& b = scene.bodies[at(body)];
    return b.orientation.normalized().conjugate() * (p - b.position);
  };
  for (const Spring& spring : scene.springs) {
    AttachedSpring s;
    s.first = spring.first;
    s.second = spring.second;
    s.at = in_body(spring.first, spring.at);
    s.at_second = in_body(spring.second, spring.at_second);
    s.stiffness = spring.stiffness;
    s.damping = spring.damping;
    s.rest = spring.rest.value_or((spring.at - spring.at_second).norm());
    all.push_back(s);
  }
  return all;
}

double potential_energy(const std::vector<AttachedSpring>& springs, const BodySet& bodies) {
  double sum = 0;
  for (const AttachedSpring& s : springs) {
    const double stretch =
        (end(bodies, s.first, s.at).point - end(bodies, s.second, s.at_second).point).norm() -
        s.rest;
    sum += 0.5 * s.stiffness * stretch * stretch;
  }
  return sum;
}

void add_forces(const Scene& scene, const std::vector<AttachedSpring>& springs,
                contact::Stepper& stepper) {
  if (!springs.empty()) {
    for (std::size_t k = 0; k < springs.size(); ++k)
      check_step(scene, springs[k], scene.springs[k], stepper.bodies(), stepper.options().step);
    stepper.add_force("springs",
                      [springs](BodySet& b, double, double dt) { pull(springs, b, dt); });
  }
  if (!scene.loads.empty())
    stepper.add_force("loads", [loads = scene.loads](BodySet& bodies, double, double dt) {
      for (const Load& load : loads) {
        RigidBody& b = bodies.motion[at(load.body)];
        b.velocity += dt * b.inverse_mass * load.force;
        b.angular_velocity += dt * (b.inverse_inertia * load.torque);
      }
    });
  std::vector<Dragged> dragged;
  for (std::size_t k = 0; k < scene.bodies.size(); ++k)
    if (scene.bodies[k].drag && !scene.bodies[k].fixed)
      dragged.push_back({static_cast<int>(k), *scene.bodies[k].drag});
  if (!dragged.empty())
    stepper.add_force("drag", [dragged](BodySet& b, double, double dt) { brake(dragged, b, dt); });
}

}  // namespace tether::scene::stepping
