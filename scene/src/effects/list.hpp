// Tether: all effects. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bounds.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

/// Every effect that a scene may name, in the order of CMakeLists.txt beside this file.
const std::vector<const Effect*>& all();

/// The forces of those that the scene names, in that order. `bodies`: at t = 0.
std::vector<std::unique_ptr<mechanics::Force>> make_forces(const Scene& scene,
                                                           const mechanics::Bodies& bodies);

/// Whether joints have limits, motors or friction, which stepping alone has.
bool has_joint_laws(const Scene& scene);

/// Whether only weight, springs without damping, joints without laws, and contacts act, of which
/// those that stick and roll do no work: what they leave of the energy is an error.
bool keeps_energy(const Scene& scene);

/// When forces have kinks or jump: in order, each once, after t = 0.
std::vector<double> kinks_of(const Scene& scene);

/// The first of these after t; infinite: there is none.
inline double next_kink(const std::vector<double>& kinks, double t) {
  const auto next = std::upper_bound(kinks.begin(), kinks.end(), t);
  return next != kinks.end() ? *next : kInfinity;
}

/// Components of momentum and angular momentum that all effects together conserve.
mechanics::Momenta momenta_of(const Scene& scene);

}  // namespace tether::scene::effects
