// Tether: the units that a smooth scene is solved in. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

#include "dimensions.hpp"

namespace tether::scene::smooth {

/// By the largest lever arms and distances of bodies that move, the shortest time that velocities
/// and effects have at this size, and the heaviest body.
Units natural_units(const Scene& scene);

/// The same, but SI where all of them are ordinary; see Units.
Units units_of(const Scene& scene);

/// The scene with all numbers divided by their units; expectations, outputs and its end left out.
Scene in_units(const Scene& scene, const Units& units);

/// Back to SI. `drift` is in SI already: its parts have several units.
void to_si(const Units& units, BodyState& body);
void from_si(const Units& units, BodyState& body);
void to_si(const Units& units, Diagnostics& diagnostics);
void to_si(const Units& units, const Scene& scene, scene::Forces& forces);

}  // namespace tether::scene::smooth

namespace tether::scene::event {

/// As those of smooth::units_of where these are not SI; else never above 1 m and 1 s, and
/// below them natural ones: bands and tolerances of a toy of millimetres are parts of a millimetre.
inline Units units_of(const Scene& scene) {
  const Units usual = smooth::units_of(scene);
  if (usual.length != 1 || usual.time != 1) return usual;
  Units units = smooth::natural_units(scene);
  units.length = std::min(1.0, units.length);
  units.time = std::min(1.0, units.time);
  return units;
}

/// As smooth::in_units, with the shapes.
inline Scene scaled(const Scene& scene, const Units& u) {
  Scene out = smooth::in_units(scene, u);
  for (Body& body : out.bodies)
    for (Shape& shape : body.shapes) {
      shape.radius /= u.length;
      shape.length /= u.length;
      shape.size /= u.length;
      shape.position /= u.length;
      for (Eigen::Vector3d& p : shape.points) p /= u.length;
    }
  return out;
}

/// Origin of the engine in a scene in its units: 0 unless the scene is further away than 30 of its
/// sizes. Positions there would lose digits of gaps and joints, and tolerances relative to them
/// would mean nothing. A multiple of a power of two, so that near bodies are moved exactly.
inline Eigen::Vector3d origin_of(const Scene& scene) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  int moving = 0;
  for (const Body& body : scene.bodies)
    if (!body.fixed) {
      middle += body.position;
      ++moving;
    }
  if (moving == 0) return middle;
  middle /= moving;
  double size = 1;
  for (const Body& body : scene.bodies)
    if (!body.fixed) size = std::max(size, (body.position - middle).norm());
  if (!(middle.norm() > 30 * size)) return Eigen::Vector3d::Zero();
  const double grid = std::exp2(std::ceil(std::log2(size)));
  return (middle / grid).array().round() * grid;
}

/// The scene as it is seen from `origin`: what it says in world coordinates.
inline Scene seen_from(const Eigen::Vector3d& origin, Scene scene) {
  if (origin.isZero(0)) return scene;
  for (Body& body : scene.bodies) body.position -= origin;
  for (Joint& joint : scene.joints) {
    joint.at -= origin;
    joint.at_second -= origin;
    if (joint.closed) {
      joint.closed->position -= origin;
      // The frame of the world has moved with the origin.
      if (joint.second < 0) joint.closed->position += joint.closed->orientation * origin;
    }
  }
  if (scene.start)
    for (BodyState& body : scene.start->bodies) body.position -= origin;
  for (Spring& spring : scene.springs) {
    spring.at -= origin;
    spring.at_second -= origin;
    if (spring.cable)
      for (Ring& ring : spring.cable->rings) ring.at -= origin;
  }
  for (CentralGravity& each : scene.central_gravity) each.at -= origin;
  return scene;
}

}  // namespace tether::scene::event
