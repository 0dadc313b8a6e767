// Tether: the stepping engine of a scene. SPDX-License-Identifier: BSD-3-Clause
#include "stepping_engine.hpp"

namespace tether::scene {

std::unique_ptr<Engine> make_stepping_engine(const Scene& scene) {
  return std::make_unique<stepping::SteppingEngine>(scene);
}

}  // namespace tether::scene
