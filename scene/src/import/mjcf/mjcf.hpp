// Tether: reads MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "import/robot/model.hpp"
#include "import/robot/xml.hpp"

namespace tether::scene::import {

/// `root`: <mujoco>. Problems are reported; the model is of use where there are none.
Model read_mjcf(const Node& root, Problems& problems);

}  // namespace tether::scene::import
