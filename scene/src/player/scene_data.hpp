// Tether: what a page shows of a scene: shapes, joints, springs. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "film.hpp"

namespace tether::scene::player {

/// Centre and size of the bodies at the start, planes apart.
View view_of(const Scene& scene);

/// The object of the page, without what the film adds. `moving`: as in Film.
nlohmann::json scene_data(const Scene& scene, const std::vector<std::size_t>& moving,
                          const View& view);

}  // namespace tether::scene::player
