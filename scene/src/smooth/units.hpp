// Tether: units in which the numbers of a scene are near 1. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>

namespace tether::scene::smooth {

/// SI for scenes of 1 mm to 1 km and of times of 1 ms to 1000 s; beyond, powers of 2 near the
/// scene's own length, time and mass, so that conversions are exact. Tolerances are absolute in
/// them.
struct Units {
  double length = 1, time = 1, mass = 1;  // m, s, kg

  double speed() const { return length / time; }
  double force() const { return mass * length / time / time; }
  double energy() const { return force() * length; }
  double momentum() const { return mass * speed(); }
  double angular_momentum() const { return momentum() * length; }
};

/// By the largest lever arms and distances of bodies that move, the shortest time that gravity,
/// velocities, springs, loads and motions have at this size, and the heaviest body.
Units units_of(const Scene& scene);

/// The scene with all numbers divided by their units; expectations, outputs and its end left out.
Scene in_units(const Scene& scene, const Units& units);

/// Back to SI. `drift` is in SI already: its parts have several units.
void to_si(const Units& units, BodyState& body);
void to_si(const Units& units, Diagnostics& diagnostics);

}  // namespace tether::scene::smooth
