// Tether: links and joints of a URDF as a tree. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "import/robot/model.hpp"
#include "import/robot/xml.hpp"

namespace tether::scene::import {

struct UrdfJoint {
  std::string name, parent, child;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::vector<LinkJoint> joints;  ///< none: fixed
  int line = 0;
};

/// Parents before children. Reports names that stand twice, joints to links that are not there,
/// links that several joints carry, loops, and a second root.
std::vector<Link> in_tree_order(std::vector<Link> links, const std::vector<UrdfJoint>& joints,
                                Problems& problems);

}  // namespace tether::scene::import
