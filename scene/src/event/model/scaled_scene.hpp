// Tether: a scene with its shapes in other units. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "smooth/units.hpp"

namespace tether::scene::event {

/// As those of smooth::units_of where these are not SI; else never above 1 m and 1 s, and
/// below them natural ones: bands and tolerances of a toy of millimetres are parts of a millimetre.
inline smooth::Units units_of(const Scene& scene) {
  const smooth::Units usual = smooth::units_of(scene);
  if (usual.length != 1 || usual.time != 1) return usual;
  smooth::Units units = smooth::natural_units(scene);
  units.length = std::min(1.0, units.length);
  units.time = std::min(1.0, units.time);
  return units;
}

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
