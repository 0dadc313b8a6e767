// Tether: where the links of a robot stand at the start. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "import/import.hpp"
#include "import/parts.hpp"

namespace tether::scene::import {

struct LinkStart {
  std::vector<PlacedJoint> joints;  ///< those that move
  Eigen::Isometry3d pose;           ///< in the world
  Eigen::Isometry3d weld;           ///< in the frame of the parent
};

/// By the positions that options ask for, else the references of the file, or the nearest limit
/// where these lie beyond it. Throws std::invalid_argument as make_parts() does.
std::vector<LinkStart> starts_of(Model& model, const ImportOptions& options);

}  // namespace tether::scene::import
