// Tether: actuators and tendons of MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mjcf_settings.hpp"

namespace tether::scene::import::mjcf {

/// Names those that act by themselves, which scenes do not have. After all joints.
void read_tendons(const Node& root, const Settings& settings, Names& names, Model& model,
                  Problems& problems);

/// Reads an element below <actuator>, after all tendons. Another law than an affine one gets a
/// remark.
void read_actuator(const Node& node, const Settings& settings, Names& names, Model& model,
                   Problems& problems);

}  // namespace tether::scene::import::mjcf
