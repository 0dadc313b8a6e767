// Tether: what a pair of features is at the state of its two bodies. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "mechanics/bodies.hpp"

namespace tether::scene::event {

using namespace mechanics;

constexpr double kNoBorder = std::numeric_limits<double>::infinity();
/// The gap of features that do not face each other.
constexpr double kNowhere = -std::numeric_limits<double>::infinity();

/// Sine by which features that lie flush in a face may be turned beyond it by rounding.
constexpr double kFlush = 0.1;

struct Touch {
  double gap = 0, rate = 0, second = 0;
  Vector3d normal = Vector3d::UnitZ(), point = Vector3d::Zero();
  Vector3d normal_rate = Vector3d::Zero();     ///< n'
  Vector3d point_velocity = Vector3d::Zero();  ///< of the contact point as it moves over the bodies
};

}  // namespace tether::scene::event
