// Tether: <equality> of MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import::mjcf {

/// Reads an element below <equality>: connect and weld become closures, joint becomes a mimic.
/// False: it is none of them. After all of the joints.
bool read_equality(const Node& node, Model& model, Problems& problems);

}  // namespace tether::scene::import::mjcf
