// Tether: points at which convex shapes lie against each other. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/shapes.hpp>

#include "stepping/detection/convex_shape.hpp"
#include "stepping/detection/nearest_directions.hpp"

namespace tether::contact::detail {

constexpr double kHigh = 0.1;  // of the thickness: what may lie against a surface

/// Both shapes of a pair about a common origin, and where their points go.
struct ConvexPair {
  const ConvexShape &a, &b;
  const Eigen::Vector3d& origin;
  const Separation& apart;
  double margin;
  NearPoints& out;

  /// Up to which what lies against the normal may touch.
  double height() const;
  /// Points of the shapes without their radius, on a line along the normal.
  void add(const Eigen::Vector3d& on_a, double core_gap, int feature) const;
};

/// All points at which the surfaces lie against each other across the normal, given what of each
/// lies against it; clips these.
void manifold(const ConvexPair& pair, Flat& s, Flat& t);

}  // namespace tether::contact::detail
