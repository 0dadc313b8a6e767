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
