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
constexpr char kBodiesFirst[8] = {'b', 'o', 'd', 'i', 'e', 's', ' ', '1'};

inline void put_bodies(std::ostream& out, double time, const std::vector<BodyState>& bodies) {
  out.write(kBodiesFirst, sizeof kBodiesFirst);
  binary::put(out, static_cast<std::uint64_t>(bodies.size()), time);
  for (const BodyState& b : bodies)
    binary::put_array(out, b.position, b.orientation.coeffs(), b.velocity, b.angular_velocity);
}

/// Reads what put_bodies() wrote after its first letters; returns the time. Throws
/// std::runtime_error on other numbers of bodies and on what is no motion.
inline double get_bodies(std::istream& in, std::vector<BodyState>& bodies) {
  if (binary::get<std::uint64_t>(in) != bodies.size())
    throw std::runtime_error("the saved state is of another scene: of another size");
  const double time = binary::get<double>(in);
  for (BodyState& b : bodies) {
    binary::get_array(in, b.position, b.orientation.coeffs(), b.velocity, b.angular_velocity);
    if (!b.is_finite() || !(std::abs(b.orientation.norm() - 1) < 1e-6))
      throw std::runtime_error("the saved state is damaged");
  }
  return time;
}

}  // namespace tether::scene
