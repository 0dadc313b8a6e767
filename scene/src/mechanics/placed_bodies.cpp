// Tether: the bodies of a scene in their first places. SPDX-License-Identifier: BSD-3-Clause
#include "placed_bodies.hpp"

namespace tether::scene::mechanics {

Bodies placed_bodies(const Scene& scene) {
  const std::size_t count = scene.bodies.size();
  Bodies bodies;
  bodies.inertia.resize(count + 1);
  bodies.frames.resize(count + 1);
  bodies.w.assign(count + 1, Vector3d::Zero());
  for (std::size_t b = 0; b <= count; ++b) {
    Frame<double>& f = bodies.frames[b];
    f.x = f.v = f.W = f.a = f.alpha = Vector3d::Zero();
    f.R = Matrix3d::Identity();
    if (b == count) continue;  // the world
    f.x = scene.bodies[b].position;
    f.R = scene.bodies[b].orientation.normalized().toRotationMatrix();
  }
  return bodies;
}

}  // namespace tether::scene::mechanics
