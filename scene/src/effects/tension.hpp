// Tether: what springs and cables share. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mechanics/effect.hpp"

namespace tether::scene::effects {

/// The largest inverse mass of a point of a body in any direction, 1/kg.
inline double softness(const mechanics::Bodies& bodies, int body, const Eigen::Vector3d& where) {
  if (!bodies.moves(body)) return 0.0;
  const mechanics::Inertia& inertia = bodies.inertia[linalg::at(body)];
  return 1 / inertia.mass + where.squaredNorm() * inertia.inverse.trace();
}

/// Explicit springs of a semi-implicit step need dt^2 k / m < 4 and dt c / m < 2; together
/// dt^2 k + 2 dt c < 4 m. `inverse`: 1 / m along the spring.
inline void check_tension_step(const Scene& scene, const Spring& spring, double inverse,
                               double dt) {
  if ((dt * spring.stiffness + 2 * spring.damping) * dt * inverse < 4) return;
  const double c = 2 * spring.damping * inverse, k = spring.stiffness * inverse;
  const double most = k > 0 ? (std::sqrt(c * c + 16 * k) - c) / (2 * k) : 4 / c;
  throw std::invalid_argument(fmt::format(
      "{}:{}: {} \"{}\": a step of {:g} s is too long for it to be stable; stepping.step "
      "must be below about {:g} s (or, without contacts, use the smooth engine)",
      scene.file, spring.place.line, spring.cable ? "cable" : "spring", spring.name, dt, most));
}

inline void report_tension(std::size_t index, const SpringForce& force, Forces& forces) {
  forces.springs.resize(std::max(forces.springs.size(), index + 1));
  forces.springs[index] = force;
  forces.springs[index].tension_second = force.tension;
}

}  // namespace tether::scene::effects
