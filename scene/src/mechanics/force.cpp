// Tether: impulses of forces. SPDX-License-Identifier: BSD-3-Clause
#include "force.hpp"

namespace tether::scene::mechanics {

void Force::step(SteppedBodies& stepped, double dt) const {
  const Bodies& bodies = stepped.bodies();
  std::vector<Load6>& loads = stepped.loads();
  for (Load6& load : loads) load.force = load.torque_body = load.torque_world = Vector3d::Zero();
  add(bodies, loads);
  for (int b = 0; b < bodies.world(); ++b) {
    if (!bodies.moves(b)) continue;
    const Load6& load = loads[at(bodies.inertia[at(b)].slot)];
    const Vector3d torque = load.torque_world + bodies.frames[at(b)].R * load.torque_body;
    stepped.push(b, dt, load.force, torque);
  }
}

}  // namespace tether::scene::mechanics
