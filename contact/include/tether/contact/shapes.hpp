// Tether: shapes of rigid bodies, and where they touch. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Kinds of shapes; all but planes and meshes may move.
enum class ShapeKind : std::uint8_t {
  sphere,
  plane,
  box,
  capsule,
  convex,
  points,
  ellipsoid,
  cylinder,
  mesh
};

/// All of them.
inline constexpr std::array<ShapeKind, 9> kShapeKinds{
    ShapeKind::sphere,    ShapeKind::plane,    ShapeKind::box,
    ShapeKind::capsule,   ShapeKind::convex,   ShapeKind::points,
    ShapeKind::ellipsoid, ShapeKind::cylinder, ShapeKind::mesh};

/// The enumerator as text.
const char* name(ShapeKind kind);

/// Given in the axes of its body; `position` and `orientation` place it on the body.
struct Shape {
  ShapeKind kind = ShapeKind::sphere;  ///< decides which of the numbers below count
  double radius = 0;                   ///< sphere, capsule, cylinder: m
  double length = 0;  ///< axis z; capsule: between the centres of its caps, cylinder: whole, m
  Eigen::Vector3d size = Eigen::Vector3d::Zero();     ///< box: full edges, ellipsoid: half axes, m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< plane: unit, out of the half-space
  std::vector<Eigen::Vector3d> points;  ///< convex, mesh: vertices; points: touching points
  /// mesh: indices of its points, counterclockwise seen from outside, where the bodies are.
  std::vector<std::array<int, 3>> triangles;
  double concavity = 0;  ///< mesh: depth of hollows that convex_parts() may fill, m
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< of its origin, m
  linalg::Quaternion orientation = linalg::Quaternion::Identity();  ///< unit; shape to body

  // Lengths in m, > 0; a Stepper refuses others.

  /// Centred at the origin, as boxes, capsules, ellipsoids and cylinders.
  static Shape sphere(double radius);
  /// Through the origin; the normal leads out of the solid half space.
  static Shape plane(const Eigen::Vector3d& normal);
  /// Full edges along x, y and z.
  static Shape box(const Eigen::Vector3d& size);
  /// `length` is between the centres of its caps, along z.
  static Shape capsule(double radius, double length);
  /// The hull of its vertices.
  static Shape convex(std::vector<Eigen::Vector3d> vertices);
  /// Half axes along x, y and z.
  static Shape ellipsoid(const Eigen::Vector3d& half_axes);
  /// Solid, with flat ends.
  static Shape cylinder(double radius, double length);
  /// A surface of triangles, on bodies that are fixed (detection, section 4).
  static Shape mesh(std::vector<Eigen::Vector3d> vertices,
                    std::vector<std::array<int, 3>> triangles);
  /// The mesh of heights[k nx + i] above (i dx, k dy): at least two in each direction. Throws
  /// std::invalid_argument unless nx divides their number.
  static Shape height_field(const std::vector<double>& heights, int nx, double dx, double dy);
  /// Points that touch other shapes, but neither meshes nor each other.
  static Shape touching_points(std::vector<Eigen::Vector3d> points);
};

/// The solid within a closed mesh, whose triangles run counterclockwise seen from outside, as
/// convex shapes that do not overlap: what a body that moves has in place of a mesh. Exact, or with
/// hollows up to `concavity` deep filled. A convex mesh is one shape with the same points. Throws
/// std::invalid_argument naming the triangle or edge that bounds no solid, and where more than 1000
/// parts are needed.
std::vector<Shape> convex_parts(const Shape& mesh);

/// A convex piece of the surface of a body, in its axes.
struct OpenFace {
  Eigen::Vector3d normal;                ///< unit, outwards
  std::vector<Eigen::Vector3d> corners;  ///< counterclockwise seen from outside, m
};
/// For each of the shapes of a body: if it is a box or hull with another one against its faces,
/// what these leave of them; else nothing. Throws std::invalid_argument if a hull is flat.
std::vector<std::vector<OpenFace>> open_faces(const std::vector<Shape>& shapes);

/// World position and orientation of a shape.
struct Pose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< of its origin, m
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< shape to world
};

/// One point at which two shapes are near. World coordinates.
struct NearPoint {
  Eigen::Vector3d on_first, on_second;  ///< the nearest points of both, m
  Eigen::Vector3d normal;               ///< unit, from second to first
  double gap = 0;                       ///< along the normal; < 0: penetration
  std::uint16_t feature = 0;  ///< the same from step to step while the same features touch
};

/// The points of one pair, in storage that is used again: set `count` to 0 before.
struct NearPoints {
  std::vector<NearPoint> point;  ///< the first `count` of them
  int count = 0;                 ///< points that hold
  /// Appends a point; see NearPoint.
  void add(const Eigen::Vector3d& on_first, const Eigen::Vector3d& on_second,
           const Eigen::Vector3d& normal, double gap, int feature) {
    if (count == static_cast<int>(point.size())) point.resize(2 * point.size() + 8);
    point[static_cast<std::size_t>(count++)] = {on_first, on_second, normal, gap,
                                                static_cast<std::uint16_t>(feature)};
  }
};

}  // namespace tether::contact
TETHER_EXPORT_END
