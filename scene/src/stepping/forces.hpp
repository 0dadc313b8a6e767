// Tether: forces of a scene as stages of a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene::stepping {

/// A spring in the axes of its bodies.
struct AttachedSpring {
  int first = -1, second = -1;    // -1: the world
  Eigen::Vector3d at, at_second;  // in body axes from the centre; world: in world axes
  double stiffness = 0, damping = 0, rest = 0;
};

std::vector<AttachedSpring> attach(const Scene& scene);
double potential_energy(const std::vector<AttachedSpring>& springs, const contact::BodySet& bodies);

/// One stage for each kind of force that the scene names. Throws std::invalid_argument on springs
/// for which the step is too long to be stable.
void add_forces(const Scene& scene, const std::vector<AttachedSpring>& springs,
                contact::Stepper& stepper);

}  // namespace tether::scene::stepping
