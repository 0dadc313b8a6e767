// Tether: scenes. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/engine.hpp>
#include <tether/scene/words.hpp>

// Every value of scene.hpp has a word: the last one of each enumeration is found.
namespace tether::scene {
static_assert(word(kJointWords.back().second) != "?" &&
              word(InvariantKind::angular_momentum) == "angular_momentum" &&
              word(Formulation::stabilised_index2) == "stabilised_index2" &&
              word(OnFailure::warn) == "warn" && word(Otherwise::stepping) == "stepping" &&
              word(Quantity::spring_force) == "spring_force");
}  // namespace tether::scene
