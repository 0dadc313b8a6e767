// Tether: impulses of forces. SPDX-License-Identifier: BSD-3-Clause
#include "force.hpp"

#include <Eigen/LU>

namespace tether::scene::mechanics {

Bodies placed_bodies(const Scene& scene) {
  const std::size_t count = scene.bodies.size();
  Bodies bodies;
  bodies.inertia.resize(count + 1);
  bodies.frames.resize(count + 1);
  bodies.w.assign(count + 1, Vector3d::Zero());
  for (std::size_t b = 0; b <= count; ++b) {
    bodies.frames[b] = frame_at(Vector3d::Zero(), Matrix3d::Identity());
    if (b == count) continue;  // the world
    bodies.frames[b].x = scene.bodies[b].position;
    bodies.frames[b].R = scene.bodies[b].orientation.normalized().toRotationMatrix();
  }
  return bodies;
}

Bodies weighed_bodies(const Scene& scene) {
  Bodies out = placed_bodies(scene);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b)
    if (const Body& body = scene.bodies[b]; !body.fixed)
      out.inertia[b] = {out.moving++, body.mass, body.inertia, body.inertia.inverse()};
  return out;
}

std::vector<BodyState> placed_states(const Scene& scene) {
  std::vector<BodyState> out(scene.bodies.size());
  for (std::size_t b = 0; b < out.size(); ++b) {
    out[b].position = scene.bodies[b].position;
    out[b].orientation = scene.bodies[b].orientation.normalized();
  }
  return out;
}

void Bodies::put(int body, const BodyState& state) {
  Frame<double>& f = frames[at(body)];
  f.x = state.position;
  f.R = state.orientation.toRotationMatrix();
  f.v = state.velocity;
  f.W = state.angular_velocity;
  w[at(body)] = f.R.transpose() * f.W;
}

BodyState state_of(const contact::BodySet& set, int body) {
  return {set.position[at(body)], set.orientation[at(body)], set.motion[at(body)].velocity,
          set.motion[at(body)].angular_velocity};
}

void put_state(const BodyState& state, int body, contact::BodySet& set) {
  set.position[at(body)] = state.position;
  set.orientation[at(body)] = state.orientation;
  set.motion[at(body)].velocity = state.velocity;
  set.motion[at(body)].angular_velocity = state.angular_velocity;
}

SteppedBodies::SteppedBodies(const Scene& scene)
    : bodies_(weighed_bodies(scene)), before_(bodies_), loads_(at(bodies_.moving)) {}

void SteppedBodies::begin(const contact::BodySet& set, const Vector3d& weight) {
  for (int b = 0; b < set.size(); ++b) {
    if (!bodies_.moves(b)) continue;
    before_.put(b, state_of(set, b));
    before_.frames[at(b)].v -= weight;
  }
}

void SteppedBodies::damp(int body, double dt, const Vector3d& force, const Vector3d& torque) {
  push(body, dt, force, torque);
  if (!bodies_.moves(body)) return;
  Frame<double>& f = before_.frames[at(body)];
  f.v += dt * motion(body).inverse_mass * force;
  f.W += dt * (motion(body).inverse_inertia * torque);
}

void SteppedBodies::read(contact::BodySet& set) {
  set_ = &set;
  copy(set);
}

void SteppedBodies::copy(const contact::BodySet& set) {
  for (int b = 0; b < set.size(); ++b)
    if (bodies_.moves(b)) bodies_.put(b, state_of(set, b));
}

void SteppedBodies::set_velocity(int body, const Vector3d& velocity,
                                 const Vector3d& angular_velocity) {
  contact::RigidBody& motion = set_->motion[at(body)];
  Frame<double>& f = bodies_.frames[at(body)];
  motion.velocity = f.v = velocity;
  motion.angular_velocity = f.W = angular_velocity;
  bodies_.w[at(body)] = f.R.transpose() * f.W;
}

void SteppedBodies::push(int body, double dt, const Vector3d& force, const Vector3d& torque) {
  if (!bodies_.moves(body)) return;
  const contact::RigidBody& motion = set_->motion[at(body)];
  set_velocity(body, motion.velocity + dt * motion.inverse_mass * force,
               motion.angular_velocity + dt * (motion.inverse_inertia * torque));
}

void Force::step(SteppedBodies& stepped, double dt) const {
  const Bodies& bodies = stepped.bodies();
  std::vector<Load6>& loads = stepped.loads();
  clear(loads);
  add(bodies, loads);
  for (int b = 0; b < bodies.world(); ++b) {
    if (!bodies.moves(b)) continue;
    const Load6& load = loads[at(bodies.inertia[at(b)].slot)];
    const Vector3d torque = load.torque_world + bodies.frames[at(b)].R * load.torque_body;
    stepped.push(b, dt, load.force, torque);
  }
}

}  // namespace tether::scene::mechanics
