// Tether: shapes as polygons, for files and pictures. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

namespace tether::scene {

/// In the axes of the body. Faces are convex, counter-clockwise from outside; single points where
/// a shape has no faces.
struct Mesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<std::size_t>> faces;
  std::vector<std::size_t> single;
};

constexpr int kAround = 24;
/// `around`: segments of a circle. A plane is cut to a square of the given half edge.
Mesh mesh(const Shape& shape, int around, double half_plane);

/// The farthest point of the shapes of a body from its centre; infinite with a plane, 0 without
/// shapes.
double reach_of(const Body& body);

}  // namespace tether::scene
