// Tether: what a page shows of a scene: shapes, joints, springs. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/scene.hpp>
#include <vector>

#include "film.hpp"

namespace tether::scene::player {

/// Centre and size of the bodies at the start, planes apart.
View view_of(const Scene& scene);

/// Entries of the JSON object of the page. `moving`: as in Film.
std::string scene_entries(const Scene& scene, const std::vector<std::size_t>& moving,
                          const View& view);

}  // namespace tether::scene::player
