// Tether: joints of a robot as joints of a scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "import/parts.hpp"

namespace tether::scene::import {

/// A scene, with a comment for each of its bodies and joints.
struct Draft {
  Scene scene;
  std::vector<std::string> body_comments, joint_comments;
};

/// Adds the joints that carry `part`, which is the body `body`, on the body `on` (-1: the world).
/// Several joints are one where scenes have it (universal, ball, planar, none), else small bodies
/// stand between them.
void add_joints(const Part& part, int body, int on, const ImportOptions& options, Draft& draft,
                Remarks& remarks);

}  // namespace tether::scene::import
