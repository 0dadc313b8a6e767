// Tether: actuators and tendons of MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mjcf_settings.hpp"

namespace tether::scene::import::mjcf {

/// Names those that act by themselves, which scenes do not have.
void read_tendons(const Node& root, const Settings& settings, Model& model, Problems& problems);

/// Reads an element below <actuator>, after all tendons; `names`: of those before. Another law than
/// an affine one gets a remark.
void read_actuator(const Node& node, const Settings& settings, std::set<std::string>& names,
                   Model& model, Problems& problems);

}  // namespace tether::scene::import::mjcf
