// Tether: actuators and tendons of MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mjcf_settings.hpp"

namespace tether::scene::import::mjcf {

/// The joints of each fixed tendon by its name.
using Tendons = std::map<std::string, std::vector<Transmission>>;

/// Names those that act by themselves, which scenes do not have.
Tendons read_tendons(const Node& root, const Settings& settings, Model& model, Problems& problems);

/// Reads an element below <actuator>. Another law than an affine one gets a remark.
void read_actuator(const Node& node, const Settings& settings, const Tendons& tendons, Model& model,
                   Problems& problems);

}  // namespace tether::scene::import::mjcf
