// Tether: positions and velocities in a saved state, for an engine that did not write it.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <tether/scene/engine.hpp>
#include <vector>

#include "output/binary.hpp"

namespace tether::scene {

/// The first letters of a state that begins with its bodies.
constexpr binary::Magic kBodiesFirst = {'b', 'o', 'd', 'i', 'e', 's', ' ', '1'};

/// Their number, the time and what moves them. Throws std::runtime_error on other numbers of bodies
/// and on what is no motion.
template <class Bodies>
void exchange_bodies(binary::Archive& io, double& time, Bodies& bodies) {
  auto count = static_cast<std::uint64_t>(bodies.size());
  io(count, time);
  if (count != bodies.size())
    throw std::runtime_error("the saved state is of another scene: of another size");
  for (auto& b : bodies) {
    io(b.position, b.orientation, b.velocity, b.angular_velocity);
    io.demand(std::abs(b.orientation.norm() - 1) < 1e-6);
  }
}

}  // namespace tether::scene
