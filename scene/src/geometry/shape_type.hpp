// Tether: what scenes know of one kind of shape. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <tether/export.hpp>
#include <tether/linalg/pi.hpp>
#include <tether/scene/scene.hpp>
#include <variant>

#include "bounds.hpp"
#include "toml/fields.hpp"

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

  /// How far a point in these axes is inside the border, m.
  double margin(const Eigen::Vector3d& local) const {
    double least = kInfinity;
    for (const auto& [outward, limit] : border) least = std::min(least, limit - outward.dot(local));
    return least;
  }
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

/// Replaces the outlines of the shapes that have open faces by one, that of the surface which these
/// make up: without the seams between them.
void join_outlines(const std::vector<std::vector<contact::OpenFace>>& faces,
                   std::vector<Outline>& outlines);

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

/// Properties of a uniform solid of density 1: mass = volume, m^3; inertia about the centre, m^5.
struct MassProperties {
  double volume = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
};

/// A plane and points have none; of a mesh the solid within its surface, which has to be closed.
MassProperties mass_properties(const Shape& shape);
/// Properties of shapes that do not overlap, in the axes of their body.
MassProperties mass_properties(const std::vector<Shape>& shapes);

/// An inertia in the axes of which R has the directions as columns.
Eigen::Matrix3d rotated(const Eigen::Matrix3d& R, const Eigen::Matrix3d& inertia);
/// The inertia of a unit point mass at d.
Eigen::Matrix3d point_inertia(const Eigen::Vector3d& d);

/// Whether the principal moments are > 0 and each at most the sum of the others, but for rounding;
/// inside: by so much that rounding on the way to a scene does no harm.
bool is_inertia(const Eigen::Matrix3d& inertia, bool inside = false);

constexpr std::size_t kMostPoints = 4096;  // of a convex shape

/// A part of a shape as scene files have it.
struct ShapeField {
  const char* key;
  std::variant<double Shape::*, Eigen::Vector3d Shape::*, std::vector<Eigen::Vector3d> Shape::*,
               std::vector<std::array<int, 3>> Shape::*>
      value;
  const char* meaning;  ///< what is missing without it; null: a direction, which may be
  const char* unit = "m";
  std::size_t least = 0;  ///< of points
};

/// One for each kind of shape, in a file of its own: <kind>_type(). All is in the axes of the
/// shape, but for the outline.
class ShapeType {
 public:
  virtual ~ShapeType() = default;
  virtual std::vector<ShapeField> fields() const = 0;
  virtual void read(files::Fields& in, files::Reader& r, Shape& shape) const;
  virtual MassProperties solid(const Shape&) const { return {}; }
  virtual Mesh polygons(const Shape& shape, int around, double half_plane) const = 0;
  /// In the axes of the body; a kind without one is unknown to the event engine.
  virtual bool add_outline(const Shape&, Outline&) const { return false; }
  /// It is drawn as its silhouette.
  virtual bool is_round() const { return false; }
  /// Makes the shape, about its origin, one of size 1, and tells its size along its axes; of kinds
  /// that have no such, nothing.
  virtual std::optional<Eigen::Vector3d> make_unit(Shape&) const { return {}; }
};

/// The importer, a library of its own, asks it, too.
TETHER_EXPORT_BEGIN
const ShapeType& type_of(ShapeKind kind);
TETHER_EXPORT_END

#define TETHER_SHAPE_TYPE(kind, Type) \
  const ShapeType& kind##_type() {    \
    static const Type the_only_one;   \
    return the_only_one;              \
  }

/// A sphere, an ellipsoid or a capsule, whose half spheres are `length` apart along z.
Mesh capsule_mesh(double radius, double length, int around);
/// A solid in which the mean square of a coordinate is a part of that length squared: 1 / part.
MassProperties along_axes(double volume, const Eigen::Vector3d& lengths, double part);
/// The solid within a closed surface of faces that are counterclockwise seen from outside.
MassProperties within(const std::vector<Eigen::Vector3d>& points,
                      const std::vector<std::vector<std::size_t>>& faces);
/// Faces of the hull of points, or these one by one.
Mesh points_mesh(const std::vector<Eigen::Vector3d>& points);

namespace files {

/// shape = "mesh": points and triangles, or a file.
void read_mesh(Fields& in, Reader& r, Shape& shape);
/// The convex parts of the mesh of a body that moves; none where it bounds no solid.
std::vector<Shape> read_parts(Fields& in, Reader& r, const Shape& mesh);
/// shape = "height_field", a mesh as well: heights, or a file, and their spacing.
void read_height_field(Fields& in, Reader& r, Shape& shape);

}  // namespace files

}  // namespace tether::scene
