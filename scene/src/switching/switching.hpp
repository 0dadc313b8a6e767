// Tether: joints that attach, detach and break, in any engine. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

namespace tether::scene {

/// An engine of scenes whose joints have no windows.
using MakeEngine = std::function<std::unique_ptr<Engine>(const Scene&)>;

/// The scene in engines that `make` gives, one after the other: a new one wherever joints attach,
/// detach or break. One without such joints is `make`'s alone. Throws std::invalid_argument.
std::unique_ptr<Engine> with_switching(const Scene& scene, MakeEngine make);

namespace switching {

/// The joint as it closes with its bodies where they are: it is at 0 then, and a distance keeps
/// what it has. `time`: s.
void take_places(const Scene& scene, double time, const std::vector<BodyState>& bodies,
                 Joint& joint);

/// Changes velocities until all rows of joints that connect `closing` (joints of the scene) to
/// moving bodies are met, by the change of least kinetic energy. Returns the kinetic energy that
/// this takes, J. Throws SimulationError where rows contradict each other.
double close(const Scene& scene, double time, const std::vector<int>& closing,
             std::vector<BodyState>& bodies);

}  // namespace switching

}  // namespace tether::scene
