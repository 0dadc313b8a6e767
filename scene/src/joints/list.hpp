// Tether: all kinds of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "joint_type.hpp"

namespace tether::scene::joints {

/// Throws std::invalid_argument for a value that is no kind of joint.
const JointType& type(JointKind kind);

/// That of the scene or, without one, its kind and index.
std::string name_of(const Joint& joint, std::size_t index);

/// Its free or prescribed coordinate is an angle.
bool is_angle(const Joint& joint);

/// Rows of a joint on positions and orientations.
int row_count(const Joint& joint);

}  // namespace tether::scene::joints
