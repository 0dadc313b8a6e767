// Tether: the features by which a shape touches others. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "features.hpp"
#include "touch.hpp"

namespace tether::scene::event {

/// A point of a body with a radius. Of a vertex, the edges that leave it.
struct Knob {
  Vector3d at = Vector3d::Zero();
  double radius = 0;
  std::vector<Vector3d> edges = {};
};

/// A flat end of a cylinder: a plane with a circle about its middle.
struct End {
  PlaneFeature plane;
  double radius = 0;
};

/// In the axes of the body. Points with a radius (spheres, ends of capsules) and vertices; edges
/// and axes of capsules and cylinders; faces with their borders; ellipsoids and the discs of
/// cylinders; the ends of these.
struct Outline {
  std::vector<Knob> knobs;
  std::vector<Segment> segments;
  std::vector<PlaneFeature> faces;
  std::vector<Round> rounds;
  std::vector<End> ends;
};

Outline outline_of(const Shape& shape);
/// How far it reaches from the centre of its body; of a plane infinitely.
double reach_of(const Shape& shape);

}  // namespace tether::scene::event
