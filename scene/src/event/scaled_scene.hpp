// Tether: a scene with its shapes in other units. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "smooth/units.hpp"

namespace tether::scene::event {

/// As smooth::in_units, with the shapes, and the longest step of [event].
inline Scene scaled(const Scene& scene, const smooth::Units& u) {
  Scene out = smooth::in_units(scene, u);
  for (Body& body : out.bodies)
    for (Shape& shape : body.shapes) {
      shape.radius /= u.length;
      shape.length /= u.length;
      shape.size /= u.length;
      shape.position /= u.length;
      for (Eigen::Vector3d& p : shape.points) p /= u.length;
    }
  if (out.event) out.event->max_step /= u.time;
  return out;
}

}  // namespace tether::scene::event
