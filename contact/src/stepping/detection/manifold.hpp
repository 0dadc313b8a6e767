// Tether: points at which convex shapes lie against each other. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/shapes.hpp>

#include "stepping/detection/convex_shape.hpp"
#include "stepping/detection/nearest_directions.hpp"

namespace tether::contact::detail {

// Parts of a surface up to this height, relative to the thickness, may touch.
constexpr double kHigh = 0.1;

// Features of the points where the border of a face cuts another shape's.
constexpr int kCut = 0x800, kNoCut = 0x7f00;

/// Two shapes relative to a common origin, their separation, and the list that contacts go to.
struct ConvexPair {
  const ConvexShape &a, &b;
  const Eigen::Vector3d& origin;
  const Separation& apart;
  double margin;
  NearPoints& out;

  /// Parts of either surface within this distance along the normal may touch.
  double height() const;
  /// Adds a contact at `on_a`. `core_gap` is the gap along the normal without the radii of balls.
  void add(const Eigen::Vector3d& on_a, double core_gap, int feature) const;
};

/// Adds all contacts between the features s of a and t of b that face each other. Clips s and t.
void manifold(const ConvexPair& pair, Flat& s, Flat& t);

}  // namespace tether::contact::detail
