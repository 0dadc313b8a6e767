// Tether: a scene as bodies, surfaces and meetings of the contact library.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene::stepping {

struct Mapped {
  contact::BodySet bodies;
  std::vector<contact::Surface> surfaces;
  std::vector<contact::Meeting> meetings;
  contact::SteppingOptions options;
};

/// Throws std::invalid_argument, naming what the scene asks for and stepping does not have.
Mapped map_scene(const Scene& scene);

}  // namespace tether::scene::stepping
