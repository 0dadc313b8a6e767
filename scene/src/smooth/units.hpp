// Tether: the units that a smooth scene is solved in. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>

#include "mechanics/units.hpp"

namespace tether::scene::smooth {

using mechanics::Largest;
using mechanics::Units;

/// By the largest lever arms and distances of bodies that move, the shortest time that velocities
/// and effects have at this size, and the heaviest body.
Units natural_units(const Scene& scene);

/// The same, but SI where all of them are ordinary; see Units.
Units units_of(const Scene& scene);

/// The scene with all numbers divided by their units; expectations, outputs and its end left out.
Scene in_units(const Scene& scene, const Units& units);

/// Back to SI. `drift` is in SI already: its parts have several units.
void to_si(const Units& units, BodyState& body);
void to_si(const Units& units, Diagnostics& diagnostics);
void to_si(const Units& units, const Scene& scene, scene::Forces& forces);

}  // namespace tether::scene::smooth
