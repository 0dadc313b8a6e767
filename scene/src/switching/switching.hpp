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

}  // namespace tether::scene
