// Tether: large islands at rest and moved. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "packing.hpp"

namespace tether::contact::random {

// Which bodies have random velocities before the solve, besides those that weight gives to all of
// them in one time step.
enum class Motion {
  rest,   // none
  hit,    // one in a hundred
  shaken  // all
};

// By its enumerator's name. Throws std::invalid_argument for any other.
Motion motion(const std::string& name);

// heap: spheres that have settled in a box. spheres, bodies: a jittered lattice of spheres, or of
// bodies whose normals miss their centres. packing: a jittered close packing of such bodies.
// wall: bricks with at least eleven contacts each.
const std::vector<std::string>& families();

// An island of about `contacts` contacts. Throws std::invalid_argument for an unknown family.
Packing moved_island(const std::string& family, int contacts, double mu, Motion motion,
                     std::uint64_t seed);

}  // namespace tether::contact::random
