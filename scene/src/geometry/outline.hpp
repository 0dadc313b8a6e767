// Tether: the features by which a shape touches others. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <tether/scene/scene.hpp>

namespace tether::scene {

/// A point of a body with a radius. Of a vertex, the edges that leave it.
struct Knob {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  double radius = 0;
  std::vector<Eigen::Vector3d> edges = {};
};

/// A line of a body from `at` over `length` along `along` (a unit vector). Of the edge of a
/// polyhedron, the directions into its two faces at right angles to it; else they are zero.
struct Segment {
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), along = Eigen::Vector3d::UnitX();
  double length = 0, radius = 0;
  std::array<Eigen::Vector3d, 2> inward = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};

  bool is_sharp() const { return !inward[0].isZero(0); }
};

/// The half-space normal.(x - at) <= 0, or the face of it where all border.x <= limit.
struct Face {
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();
  std::vector<std::pair<Eigen::Vector3d, double>> border;
};

/// The points at + shape v, |v| <= 1, with a ball of `radius` around each: an ellipsoid (shape of
/// rank 3), the disc of a cylinder's end (rank 2), a sphere (0).
struct Round {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  Eigen::Matrix3d shape = Eigen::Matrix3d::Zero();
  double radius = 0;
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();  ///< of a disc: a unit vector; else zero

  bool is_disc() const { return !outward.isZero(0); }
  double size() const { return shape.norm() + radius; }
};

/// A flat end of a cylinder: a plane with a circle about its middle.
struct End {
  Face plane;
  double radius = 0;
};

/// In the axes of the body. Points with a radius (spheres, ends of capsules) and vertices; edges
/// and axes of capsules and cylinders; faces with their borders; ellipsoids and the discs of
/// cylinders; the ends of these.
struct Outline {
  std::vector<Knob> knobs;
  std::vector<Segment> segments;
  std::vector<Face> faces;
  std::vector<Round> rounds;
  std::vector<End> ends;

  /// How far it reaches from the centre of its body.
  double reach() const;
};

inline Eigen::Vector3d placed(const Shape& shape, const Eigen::Vector3d& local) {
  return shape.position + shape.orientation * local;
}
void add_axis(const Shape& shape, Outline& out);
/// Corners, and if they are those of a solid its edges and faces.
void add_corners(const Shape& shape, const std::vector<Eigen::Vector3d>& local, bool solid,
                 Outline& out);

}  // namespace tether::scene
